//! What a host can get wrong.
