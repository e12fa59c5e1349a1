//! A convolution of 3³ voxels without bias, zeros outside (DVAO §3.2). With inputs n beside each other, normalised before they are continued by zeros:
//!
//! ```text
//! y_o(v) = Σ_n Σ_{k ∈ {0,1,2}³} w_{o,n,k} x_n(v + k − 1)
//! ```
//!
//! In: up to two tensors, the channels of the second behind those of the first, of the same grid; their moments; whether they are doubled first;
//! weights of each output those of each input, of these the 27 of x, y, z, x fastest. Out: the outputs, f32. Products and sums over the 27 in f32, over inputs in f64.
//!
//! **Folded.** Of a doubled input the three taps along an axis see only two voxels: those of an even voxel 2i see i − 1, i, i, those of an odd one
//! i, i, i + 1. So each of the eight parities has a kernel of 2³, whose weights are sums of those of 3³ (8/27 of the products, exact but for rounding).

use super::Tensor;
use super::moments::Moments;
use super::resize::double;
use crate::{Grid, each};

/// The convolution, as written above; `doubled` to the nearest.
pub fn conv3(inputs: &[&Tensor], moments: &[Moments], doubled: bool, weights: &[f32]) -> Tensor {
    let twice: Vec<Tensor> = inputs.iter().map(|x| if doubled { double(x) } else { (*x).clone() }).collect();
    let (padded, dims) = (padded(&twice.iter().collect::<Vec<_>>(), moments), twice[0].dims);
    let outputs = weights.len() / 27 / padded.len();
    let [nx, ny, nz] = dims;
    let planes = each(outputs * nz, |i| {
        let (output, z) = (i / nz, i % nz);
        let kernels = &weights[27 * padded.len() * output..][..27 * padded.len()];
        (0..ny).flat_map(|y| row(&padded, kernels, [nx, ny, y, z])).collect::<Vec<f32>>()
    });
    Tensor { dims, values: planes.concat() }
}

/// One row of one output.
fn row(padded: &[Vec<f32>], kernels: &[f32], [nx, ny, y, z]: [usize; 4]) -> Vec<f32> {
    let mut sums = vec![0.0_f64; nx];
    let mut of_input = vec![0.0_f32; nx];
    for (input, kernel) in padded.iter().zip(kernels.chunks_exact(27)) {
        of_input.fill(0.0);
        for (i, taps) in kernel.chunks_exact(3).enumerate() {
            let (dy, dz) = (i % 3, i / 3);
            let near = &input[((z + dz) * (ny + 2) + y + dy) * (nx + 2)..][..nx + 2];
            let (left, right) = (&near[..nx], &near[2..]);
            for (((sum, l), m), r) in of_input.iter_mut().zip(left).zip(&near[1..]).zip(right) {
                *sum += taps[0] * l + taps[1] * m + taps[2] * r;
            }
        }
        for (sum, part) in sums.iter_mut().zip(&of_input) {
            *sum += f64::from(*part);
        }
    }
    sums.into_iter().map(|sum| sum as f32).collect()
}

/// Every channel, normalised, with a voxel of zeros around it.
fn padded(inputs: &[&Tensor], moments: &[Moments]) -> Vec<Vec<f32>> {
    let channels: Vec<&[f32]> = inputs.iter().flat_map(|input| input.channels()).collect();
    let grid = Grid { dims: inputs[0].dims, spacing: [1.0; 3] };
    assert!(inputs.iter().all(|input| input.dims == grid.dims) && channels.len() == moments.len());
    let around = Grid { dims: grid.dims.map(|d| d + 2), ..grid };
    each(channels.len(), |c| {
        let mut out = vec![0.0; around.len()];
        for (i, value) in channels[c].iter().enumerate() {
            out[around.index(grid.voxel(i).map(|v| v + 1))] = moments[c].normal(*value);
        }
        out
    })
}

/// The eight kernels of 2³ that a kernel of 3³ is on a doubled input: of each parity of the output (bit 0: x odd, 1: y, 2: z) the weights of the
/// 8 voxels (x fastest) from v/2 − 1 + parity on.
pub fn folded(kernel: &[f32; 27]) -> [[f32; 8]; 8] {
    let mut out = [[0.0; 8]; 8];
    for (parity, sums) in out.iter_mut().enumerate() {
        for (tap, weight) in kernel.iter().enumerate() {
            // Tap k of parity p is at floor((p + k − 1) / 2) of the halved grid, from p − 1 on the (p + k − 1 …)th.
            let along = |axis: u32| {
                let (k, p) = (tap / 3_usize.pow(axis) % 3, parity >> axis & 1);
                (p + k).div_ceil(2) - p
            };
            sums[along(0) + 2 * along(1) + 4 * along(2)] += weight;
        }
    }
    out
}

/// [`conv3`] of a doubled input by the folded kernels.
pub fn conv3_folded(inputs: &[&Tensor], moments: &[Moments], weights: &[f32]) -> Tensor {
    let padded = padded(inputs, moments);
    let kernels: Vec<_> = weights.as_chunks::<27>().0.iter().map(folded).collect();
    let half = Grid { dims: inputs[0].dims.map(|d| d + 2), spacing: [1.0; 3] };
    let full = Grid { dims: inputs[0].dims.map(|d| 2 * d), ..half };
    let values = each(kernels.len() / padded.len() * full.len(), |i| {
        let (output, voxel) = (i / full.len(), full.voxel(i % full.len()));
        let parity = voxel[0] % 2 + 2 * (voxel[1] % 2) + 4 * (voxel[2] % 2);
        let of = |(input, kernels): (&Vec<f32>, &[[f32; 8]; 8])| -> f64 {
            let term = |n: usize| {
                let near = std::array::from_fn(|a| voxel[a].div_ceil(2) + (n >> a & 1));
                f64::from(kernels[parity][n]) * f64::from(input[half.index(near)])
            };
            (0..8).map(term).sum()
        };
        padded.iter().zip(&kernels[padded.len() * output..]).map(of).sum::<f64>() as f32
    });
    Tensor { dims: full.dims, values }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::moments::moments;
    use crate::random::Random;

    fn random(seed: u32, dims: [usize; 3], channels: usize) -> Tensor {
        let mut random = Random(seed);
        let values =
            (0..channels * dims.iter().product::<usize>()).map(|_| random.within(-1.0, 2.0)).collect();
        Tensor { dims, values }
    }

    fn kernels(seed: u32, inputs: usize, outputs: usize) -> Vec<f32> {
        let mut random = Random(seed);
        (0..27 * inputs * outputs).map(|_| random.within(-0.3, 0.3)).collect()
    }

    #[test]
    fn a_kernel_of_its_middle_alone_is_the_identity_and_one_beside_it_a_shift() {
        let input = random(1, [5, 3, 4], 1);
        let of = |tap: usize| {
            let mut kernel = [0.0; 27];
            kernel[tap] = 1.0;
            conv3(&[&input], &[Moments::NONE], false, &kernel)
        };
        assert_eq!(of(13), input);
        let grid = Grid { dims: input.dims, spacing: [1.0; 3] };
        // Along +x, +y, +z, zeros beyond the last.
        for (axis, tap) in [(0, 14), (1, 16), (2, 22)] {
            let shifted = of(tap);
            for i in 0..grid.len() {
                let mut next = grid.voxel(i);
                next[axis] += 1;
                let expected =
                    if next[axis] < grid.dims[axis] { input.values[grid.index(next)] } else { 0.0 };
                assert_eq!(shifted.values[i], expected, "axis {axis}, voxel {i}");
            }
        }
    }

    #[test]
    fn of_ones_a_kernel_of_ones_counts_the_voxels_that_are_there() {
        let input = Tensor { dims: [3; 3], values: vec![1.0; 2 * 27] };
        let found = conv3(&[&input], &[Moments::NONE; 2], false, &[1.0; 54]);
        assert_eq!([0, 1, 4, 13].map(|i| found.values[i]), [16.0, 24.0, 36.0, 54.0]);
    }

    /// Zeros are outside after normalisation: a constant gives nothing at the border either.
    #[test]
    fn a_normalised_constant_is_zero_up_to_the_border() {
        let input = Tensor { dims: [4; 3], values: vec![3.5; 64] };
        let found = conv3(&[&input], &moments(&input), false, &kernels(2, 1, 3));
        assert_eq!(found.values, [0.0; 3 * 64]);
    }

    #[test]
    fn two_inputs_are_one_with_the_channels_of_both_the_first_first() {
        let (a, b) = (random(3, [4, 3, 2], 2), random(4, [4, 3, 2], 3));
        let both = Tensor { dims: a.dims, values: [a.values.clone(), b.values.clone()].concat() };
        let weights = kernels(5, 5, 4);
        let beside = conv3(&[&a, &b], &[moments(&a), moments(&b)].concat(), false, &weights);
        assert_eq!(beside, conv3(&[&both], &moments(&both), false, &weights));
        assert_ne!(beside, conv3(&[&b, &a], &[moments(&b), moments(&a)].concat(), false, &weights));
    }

    /// Relative to 1, what normalised inputs and such weights give: f32 sums of 27 and of folded weights.
    const FOLDED: f32 = 1e-6;

    #[test]
    fn folded_is_unfolded() {
        let (a, b) = (random(6, [3, 4, 2], 3), random(7, [3, 4, 2], 2));
        let (weights, moments) = (kernels(8, 5, 3), [moments(&a), moments(&b)].concat());
        let plain = conv3(&[&a, &b], &moments, true, &weights);
        let folded = conv3_folded(&[&a, &b], &moments, &weights);
        assert_eq!(plain.dims, folded.dims);
        let most = |x: &Tensor, y: &Tensor| {
            x.values.iter().zip(&y.values).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max)
        };
        let off = most(&plain, &folded);
        assert!(off <= FOLDED, "{off}");
        // Not so of another kernel.
        let mut other = weights.clone();
        other[40] += 0.01;
        assert!(most(&plain, &conv3_folded(&[&a, &b], &moments, &other)) > 1e-3);
    }

    #[test]
    fn folded_kernels_have_the_sum_of_the_whole_and_one_voxel_of_the_near_side() {
        let kernel = std::array::from_fn(|i| (i + 1) as f32);
        let kernels = folded(&kernel);
        assert!(kernels.iter().all(|k| k.iter().sum::<f32>() == 378.0));
        // Even along each axis: only tap 0 sees the voxel before; odd: only tap 2 the one after.
        assert_eq!((kernels[0][0], kernels[7][7], kernels[1][1]), (1.0, 27.0, 3.0));
    }
}
