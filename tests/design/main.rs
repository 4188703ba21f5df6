//! Design files: what they mean, and what is said of those that cannot be.

mod support;

mod defaults;
mod hostile;
mod messages;
mod mutations;
mod physics;
mod shapes;
mod slips;
