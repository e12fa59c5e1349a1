//! Volumes that the device cannot hold as they are: refused by limit, never cut; and values that 32 bits cannot hold.

use cao::{Error, Renderer};
use cao_gpu::Gpu;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::volume::Volume;
use cao_testing::{close, open};

fn transfer() -> TransferFunction {
    TransferFunction::new(vec![[0.0, 0.0], [1.0, 0.75]], vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap()
}

fn render(gpu: &Gpu, volume: &Volume) -> cao::Result<Renderer> {
    Renderer::new(gpu, volume, transfer(), Setup::new(1.0), cao::renderer::COLOUR)
}

#[test]
fn sizes_beyond_32_bits_are_refused_and_not_cut() {
    let gpu = open();
    let small = Volume::new([4, 1, 1], [1.0; 3], Values::U8(vec![1; 4])).unwrap();
    // 2³² + 4 voxels along an axis are not 4; and 2⁴² bricks have no numbers. The values are not needed to say so.
    for (dims, needed) in [
        ([4_294_967_300, 1, 1], 4_294_967_300),
        ([1, 1, 1 << 40], 1 << 37),
        ([1 << 20, 1 << 20, 1 << 11], 1 << 42),
    ] {
        let volume = Volume { dims, ..small.clone() };
        match render(&gpu, &volume).map(drop) {
            Err(Error::Model(cao_model::Error::Limit { needed: found, limit, .. })) => {
                assert_eq!((found, limit), (needed, u32::MAX.into()), "{dims:?}");
            }
            other => panic!("{dims:?}: {other:?}"),
        }
    }
    let mut renderer = render(&gpu, &small).unwrap();
    for dims in [[4_294_967_297, 1, 1], [usize::MAX, 1, 1], [1, usize::MAX, usize::MAX]] {
        let volume = Volume { dims, ..small.clone() };
        assert!(renderer.set_values([1, 0, 0], &volume).is_err(), "{dims:?}");
    }
    renderer
        .set_values([1, 0, 0], &Volume::new([3, 1, 1], [1.0; 3], Values::U8(vec![9; 3])).unwrap())
        .unwrap();
    drop(renderer);
    close(gpu);
}

#[test]
fn a_volume_changed_by_hand_is_checked() {
    let gpu = open();
    let good = Volume::new([4, 1, 1], [1.0; 3], Values::F32(vec![1.0; 4])).unwrap();
    let nan = Volume { values: Values::F32(vec![1.0, f32::NAN, 1.0, 1.0]), ..good.clone() };
    let few = Volume { dims: [4, 2, 1], ..good.clone() };
    let mut renderer = render(&gpu, &good).unwrap();
    for (volume, says) in [(&nan, "NaN"), (&few, "4 values, expected 8")] {
        let error = render(&gpu, volume).map(drop).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
        assert!(renderer.set_values([0; 3], volume).is_err(), "{says}");
    }
    drop(renderer);
    close(gpu);
}

#[test]
fn values_beyond_32_bits_keep_the_opacity_that_they_have() {
    let gpu = open();
    let values = vec![-1e300, 0.0, f64::from(f32::MAX), 1e300];
    let volume = Volume::new([4, 1, 1], [1.0; 3], Values::F64(values)).unwrap();
    let mut renderer = render(&gpu, &volume).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let opacity = renderer.read_opacity().unwrap();
    assert_eq!((opacity[0], opacity[1]), (0.0, 0.0));
    for i in [2, 3] {
        assert!((opacity[i] - 0.75).abs() < 1.0 / 65535.0, "{opacity:?}");
    }
    drop(renderer);
    close(gpu);
}
