//! Design files: what they mean, and what is said of those that cannot be.

#[path = "design/support.rs"]
mod support;

#[path = "design/defaults.rs"]
mod defaults;
#[path = "design/hostile.rs"]
mod hostile;
#[path = "design/messages.rs"]
mod messages;
#[path = "design/mutations.rs"]
mod mutations;
#[path = "design/physics.rs"]
mod physics;
#[path = "design/shapes.rs"]
mod shapes;
#[path = "design/slips.rs"]
mod slips;
