//! The force constant: the path of e*(lambda) and its criteria.
