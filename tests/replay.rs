//! Replays of trajectories: the physics of a replay, the command.
#![allow(clippy::disallowed_methods)] // tests write their own files

#[cfg(unix)]
#[path = "replay/command.rs"]
mod command;
#[path = "replay/physics.rs"]
mod physics;
#[path = "replay/support.rs"]
mod support;
