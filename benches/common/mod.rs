//! What the Criterion benches share.

#![forbid(unsafe_code)]

use criterion::Criterion;
use std::time::Duration;

/// Short measurements: all benches together take less than three minutes, and a change of a third still shows.
pub fn brief() -> Criterion {
    Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_millis(1500))
}
