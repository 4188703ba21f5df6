//! Replays of trajectories: the allocation of eq. 8, the physics of a replay, the command.
#![allow(clippy::disallowed_methods)] // tests write their own files

#[path = "replay/allocation.rs"]
mod allocation;
#[cfg(unix)]
#[path = "replay/command.rs"]
mod command;
#[path = "replay/physics.rs"]
mod physics;
#[path = "replay/support.rs"]
mod support;
