//! The path of e*(lambda): against exhaustive search, exact rational solutions, its own
//! certificate, closed forms and scaling laws.

mod allocation;
mod arrays;
mod criteria;
mod edges;
mod exhaustive;
mod feedback;
mod mirror;
mod oracle;
mod power;
mod saturation;

mod scale;
mod sideways;
mod two_fingers;
mod uncertainty;
mod vector_allocation;
mod vector_feedback;
mod vector_static;
mod vertices;
mod worst;
