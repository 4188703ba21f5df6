//! What broke, each by its name.
