//! Tabulation over the workspace and its error.
