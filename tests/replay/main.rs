//! Replays of trajectories: the physics of a replay, the command.
#![allow(clippy::disallowed_methods)] // tests write their own files

#[cfg(unix)]
mod command;
mod physics;
mod support;
mod two_fingers;
mod vector;
