//! What a command does, from documents to results.
