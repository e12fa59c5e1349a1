//! The kernel `filter`: what it says of a device is what pictures of 8-bit volumes need to know.

use cao::draw::filter::keeps_fractions;
use cao_testing::*;

#[test]
fn a_driver_that_is_known_to_round_is_found_out() {
    let gpu = open();
    let fine = keeps_fractions(&gpu).unwrap();
    assert_eq!(fine, keeps_fractions(&gpu).unwrap());
    if gpu.info().name.contains("llvmpipe") {
        assert!(
            !fine,
            "lavapipe filters 8-bit texels in 8 bits; where it no longer does, docs/drivers.md is to say so"
        );
    }
    close(gpu);
}
