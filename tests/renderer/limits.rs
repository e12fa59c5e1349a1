//! Volumes that the device cannot hold as they are: refused by limit, never cut; and values that 32 bits cannot hold.

use cao::{Error, Renderer};
use cao_gpu::Gpu;
use cao_model::look::Look;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::view::StereoRig;
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

/// Opacity and picture are those of the largest numbers of 32 bits: infinities of both signs side by side would make none.
#[test]
fn values_beyond_32_bits_are_the_largest_that_there_are() {
    let gpu = open();
    let most = f64::from(f32::MAX);
    let of = |large: f64| {
        let values = (0..216).map(|i| [-large, 0.0, large, 0.7][i * 7 % 4]).collect();
        Volume::new([6; 3], [1.0; 3], Values::F64(values)).unwrap()
    };
    let shown = |volume: &Volume| {
        let mut renderer = render(&gpu, volume).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        let eyes = StereoRig::framing(volume.size_mm(), 30.0, 25.0).views(1.0, 0.1, 100.0).unwrap();
        let (image, _) = renderer.draw(&eyes, &Look::default(), [48, 48]).unwrap();
        (renderer.read_opacity().unwrap(), image.colour)
    };
    let (opacity, picture) = shown(&of(1e300));
    assert!(opacity.iter().any(|a| *a > 0.7) && opacity.contains(&0.0));
    assert!(picture.iter().flatten().flatten().all(|c| c.is_finite()));
    assert!(picture[0].iter().any(|p| p[3] > 0.5));
    assert!((opacity, picture) == shown(&of(most)));
    close(gpu);
}
