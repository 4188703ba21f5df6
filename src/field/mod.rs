//! Sources to field and gradient.
