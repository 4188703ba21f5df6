//! The only writer and reader of artefacts.
