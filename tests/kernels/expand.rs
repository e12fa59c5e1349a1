//! The kernel `expand` against its twin, on clusters of a volume, and the known answers of the whole method.

use cao::drive::Take;
use cao::field::Field;
use cao::field::bricks::BrickList;
use cao::field::transfer::TransferBuffer;
use cao::field::volume_image;
use cao::histograms::clusters::{Clusters, ROUNDS};
use cao::histograms::expand::{Bindings, Expand, Scene};
use cao::histograms::histogram::{Histogram, HistogramPlan};
use cao_gpu::{Access, Format};
use cao_kernels::histogram::WORDS;
use cao_model::settings::Scope;
use cao_model::transfer::TransferFunction;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::histograms::expand::{coloured, factor};

/// V_AO is rounded to 65535ths, and 64 products are summed before.
const ROUNDED: f64 = 4.0 / 65535.0;

/// V_AO, 7 in bricks that are not listed, and what the twin makes of the device's clusters: the factor of each voxel's.
fn values(
    grid: &Grid,
    values: Vec<f32>,
    transfer: &TransferFunction,
    clusters: [u32; 2],
    reference_mm: f32,
) -> (Vec<f64>, Vec<f64>) {
    let (found, expected) = colours(grid, values, transfer, clusters, reference_mm, None);
    let first = |all: Vec<[f64; 3]>| all.into_iter().map(|c| c[0]).collect();
    (first(found), first(expected))
}

/// The same in red, green and blue, with so much colour bleeding; without any thrice the same.
fn colours(
    grid: &Grid,
    values: Vec<f32>,
    transfer: &TransferFunction,
    [clusters, block]: [u32; 2],
    reference_mm: f32,
    bleeding: Option<f32>,
) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
    let gpu = open();
    let range = values.iter().fold([f32::MAX, f32::MIN], |[l, m], v| [l.min(*v), m.max(*v)]);
    let opacity: Vec<u16> =
        values.iter().map(|v| (65535.0 * transfer.opacity_at(*v)).round() as u16).collect();
    let field = Field::upload(&gpu, &volume_of(grid, values)).unwrap();
    let plan = HistogramPlan::new(field.dims, field.spacing, 12.0, clusters, block);
    let histogram = Histogram::new(&gpu, &field, block).unwrap();
    let (groups, expand) = (Clusters::new(&gpu).unwrap(), Expand::new(&gpu, bleeding.is_some()).unwrap());
    let table = TransferBuffer::new(&gpu).unwrap();
    let image = |name, format| volume_image(&gpu, name, &field, format).unwrap();
    let channels = if bleeding.is_some() { 4 } else { 1 };
    let format = if bleeding.is_some() { Format::Rgba16Unorm } else { Format::R16Unorm };
    let (source, ambient) = (image("test opacity", Format::R16Unorm), image("test ambient", format));
    write_image(&gpu, &source, bytemuck::cast_slice(&opacity));
    write_image(&gpu, &ambient, bytemuck::cast_slice(&vec![7_u16; channels * opacity.len()]));
    // All but the last brick.
    let listed: Vec<u32> = (0..field.brick_count() - 1).collect();
    let list = BrickList::of(&gpu, &listed).unwrap();
    let scene = Scene { plan: &plan, reference_mm, scope: Scope::Needed, bleeding: bleeding.unwrap_or(0.0) };
    let b = Bindings { opacity: &source, index: &histogram.index, list: &list, ambient: &ambient };
    run(&gpu, |rec| {
        histogram.record_samples(rec, &field, &plan).unwrap();
        groups.record_seed(rec, &plan, &histogram.sampled).unwrap();
        (0..ROUNDS).for_each(|round| groups.record_round(rec, &plan, &histogram.sampled, round).unwrap());
        for slab in 0..plan.slab_count() {
            histogram.record_slab(rec, &field, &plan, &groups.centres, slab).unwrap();
        }
        table.record(rec, transfer).unwrap();
        let buffers = [&histogram.extent_of, &groups.centres, &table.buffer];
        expand.record_shade(rec, &field, scene, buffers).unwrap();
        expand.record(rec, &field, scene, b, &Take::All).unwrap();
        rec.barrier(&[Access::StorageWrite, Access::SampledRead], &[Access::TransferRead]);
    });
    let texels = |image| bytemuck::pod_collect_to_vec::<u8, u16>(&read_image(&gpu, image));
    let (found, index) = (texels(&ambient), texels(&histogram.index));
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &groups.centres));
    let exponent = grid.min_spacing() / f64::from(reference_mm);
    let factors: Vec<[f64; 3]> = words
        .chunks(WORDS as usize)
        .take(plan.clusters as usize)
        .map(|centre| {
            let shares: Vec<u32> = centre.iter().flat_map(|w| [w & 0xffff, w >> 16]).collect();
            match bleeding {
                None => [factor(&shares, transfer, range, exponent); 3],
                Some(bleeding) => coloured(&shares, transfer, range, exponent, bleeding.into()),
            }
        })
        .collect();
    let coarse = Grid { dims: plan.coarse.map(|d| d as usize), ..*grid };
    let expected = (0..grid.len())
        .map(|i| factors[usize::from(index[coarse.index(grid.voxel(i).map(|c| c / block as usize))])])
        .collect();
    drop((histogram, groups, expand, table, source, ambient, list, field));
    close(gpu);
    let found = found
        .chunks(channels)
        .map(|texel| [0, 1, 2].map(|c| f64::from(texel[c.min(channels - 1)]) / 65535.0));
    (found.collect(), expected)
}

fn ramp(points: Vec<[f32; 2]>) -> TransferFunction {
    TransferFunction::new(points, vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap()
}

#[test]
fn every_voxel_has_its_clusters_factor() {
    let grid = Grid { dims: [18, 17, 19], spacing: [1.0, 1.0, 1.5] };
    let made: Vec<f32> = (0..grid.len())
        .map(|i| {
            let [x, y, z] = grid.voxel(i);
            ((x * x + 3 * y + z * y) % 97) as f32 + if x > 8 { 60.0 } else { 0.0 }
        })
        .collect();
    let transfer = ramp(vec![[20.0, 0.01], [90.0, 0.8], [120.0, 0.2]]);
    for (block, reference_mm) in [(1, 1.0), (2, 1.0), (1, 2.5)] {
        let (found, expected) = values(&grid, made.clone(), &transfer, [12, block], reference_mm);
        let last = |i: usize| grid.voxel(i).iter().all(|c| *c >= 16);
        for (i, (f, e)) in found.iter().zip(&expected).enumerate() {
            match last(i) {
                true => assert_eq!(*f, 7.0 / 65535.0, "not listed"),
                false => assert!((f - e).abs() <= ROUNDED, "{:?}: {f} {e}", grid.voxel(i)),
            }
        }
        assert!(found.iter().any(|f| (f - found[0]).abs() > 0.05), "all are the same");
    }
}

#[test]
fn known_answers() {
    // So wide that there are clusters of voxels that no border is near to.
    let grid = Grid { dims: [50, 50, 26], spacing: [1.0; 3] };
    let at = grid.index([25, 25, 12]);
    let transfer = ramp(vec![[0.0, 0.0], [1.0, 1.0]]);
    // Uniform, far from the border: 1 - a.
    let even = ramp(vec![[0.0, 0.3], [1.0, 0.3]]);
    let inner = values(&grid, vec![5.0; grid.len()], &even, [64, 1], 1.0).0[at];
    assert!((inner - 0.7).abs() < 0.01, "{inner}");
    // The first solid layer of a half-space, within what a cluster has of neighbours.
    let half = (0..grid.len()).map(|i| f32::from(u8::from(grid.voxel(i)[2] <= 12))).collect();
    let (found, _) = values(&grid, half, &transfer, [4096, 1], 1.0);
    assert!((found[at] - 0.4359).abs() < 0.03, "{}", found[at]);
    // Not needed.
    assert_eq!(found[grid.index([25, 25, 20])], 1.0);
}

/// Every channel equals the twin's, which has the known answers.
#[test]
fn matter_lends_its_colour() {
    let grid = Grid { dims: [18, 17, 19], spacing: [1.0, 1.0, 1.5] };
    let made: Vec<f32> = (0..grid.len())
        .map(|i| {
            let [x, y, z] = grid.voxel(i);
            ((x + 3 * y + z * y) % 40) as f32 + if x > 8 { 60.0 } else { 0.0 }
        })
        .collect();
    let points = vec![[20.0, 0.1], [90.0, 0.8]];
    let colour = vec![[0.0, 1.0, 0.5, 0.0], [60.0, 0.1, 0.4, 0.9], [97.0, 0.9, 0.9, 0.1]];
    let transfer = TransferFunction::new(points, colour, None).unwrap();
    let (found, expected) = colours(&grid, made, &transfer, [12, 2], 2.5, Some(0.6));
    for (i, (f, e)) in found.iter().zip(&expected).enumerate() {
        let listed = grid.voxel(i).iter().any(|c| *c < 16);
        let off = (0..3).map(|c| (f[c] - if listed { e[c] } else { 7.0 / 65535.0 }).abs());
        assert!(off.fold(0.0, f64::max) <= ROUNDED, "{:?}: {f:?} {e:?}", grid.voxel(i));
    }
    let apart = |a: usize, b: usize| found.iter().any(|c| (c[a] - c[b]).abs() > 0.01);
    assert!(apart(0, 1) && apart(1, 2), "no colours");
}
