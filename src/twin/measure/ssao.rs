//! Image-space ambient occlusion, the control that must *fail* where data-space values agree: it knows only what one
//! eye's depth image shows, so the two eyes shade the same point differently (Shi et al. 2022, CAO §1).
//!
//! As VTK's pass: at each pixel a hemisphere of K points within R around the surface, rotated by a hash of the pixel;
//!
//! ```text
//! AO = 1 − 1/K Σ_i [surface at the pixel of p_i is nearer than p_i] · smoothstep(R / |z − z_i|)
//! ```

use crate::each;
use cao_model::view::View;
use glam::{Mat3, Vec2, Vec3};

/// Settings of the control.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// R, radius of the hemisphere in mm.
    pub radius_mm: f32,
    /// K, points in it.
    pub samples: u32,
    /// A surface hides a point only if it is nearer by more than this, in mm.
    pub bias_mm: f32,
}

/// Ambient value of every pixel from a depth image (Vulkan depth, rows from the top); 1 where nothing was drawn.
pub fn ssao(depth: &[f32], size: [usize; 2], view: &View, settings: &Settings) -> Vec<f32> {
    let points: Vec<Option<Vec3>> = (0..depth.len()).map(|i| unproject(depth[i], size, view, i)).collect();
    let kernel = kernel(settings.samples);
    each(depth.len(), |i| {
        points[i].map_or(1.0, |point| pixel(point, i, &points, size, view, &kernel, settings))
    })
}

/// Point of the eye's frame (mm, looking down −z) that a pixel shows.
fn unproject(depth: f32, [width, height]: [usize; 2], view: &View, i: usize) -> Option<Vec3> {
    if depth >= 1.0 {
        return None;
    }
    let uv = Vec2::new((i % width) as f32 + 0.5, (i / width) as f32 + 0.5)
        / Vec2::new(width as f32, height as f32);
    let (near, far) = (view.near_mm, view.far_mm);
    let distance = near * far / (far - depth * (far - near));
    Some(view.orientation.inverse() * view.ray(uv).1 * distance)
}

fn pixel(
    point: Vec3,
    i: usize,
    points: &[Option<Vec3>],
    size: [usize; 2],
    view: &View,
    kernel: &[Vec3],
    settings: &Settings,
) -> f32 {
    let [width, height] = size.map(|s| s as isize);
    let at = |x: isize, y: isize| {
        let inside = (0..width).contains(&x) && (0..height).contains(&y);
        if inside { points[(y * width + x) as usize] } else { None }
    };
    let (x, y) = (i as isize % width, i as isize / width);
    // Of the differences to the two neighbours the shorter one: the other may cross an edge.
    let along = |dx: isize, dy: isize| {
        let ahead = at(x + dx, y + dy).map(|p| p - point);
        let behind = at(x - dx, y - dy).map(|p| point - p);
        match (ahead, behind) {
            (Some(a), Some(b)) => Some(if a.length() <= b.length() { a } else { b }),
            (a, b) => a.or(b),
        }
    };
    let (Some(right), Some(down)) = (along(1, 0), along(0, 1)) else {
        return 1.0;
    };
    let normal = down.cross(right).normalize_or(Vec3::Z);
    let angle = hash(i as u32) * std::f32::consts::TAU;
    let around = normal.any_orthonormal_vector();
    let tangent = around * angle.cos() + normal.cross(around) * angle.sin();
    let frame = Mat3::from_cols(tangent, normal.cross(tangent), normal);

    let hidden: f32 = kernel
        .iter()
        .map(|&k| {
            let sample = point + frame * k * settings.radius_mm;
            if sample.z >= 0.0 {
                return 0.0;
            }
            let t = view.tan;
            let uv = Vec2::new(
                (sample.x / -sample.z - t.left) / (t.right - t.left),
                (sample.y / -sample.z - t.up) / (t.down - t.up),
            );
            let place = (uv * Vec2::new(width as f32, height as f32)).floor();
            let Some(surface) = at(place.x as isize, place.y as isize) else {
                return 0.0;
            };
            if surface.z < sample.z + settings.bias_mm {
                return 0.0;
            }
            let range = settings.radius_mm / (point.z - surface.z).abs().max(settings.radius_mm);
            range * range * (3.0 - 2.0 * range)
        })
        .sum();
    1.0 - hidden / kernel.len().max(1) as f32
}

/// Points of the unit hemisphere around +z, denser towards its centre.
fn kernel(samples: u32) -> Vec<Vec3> {
    (0..samples)
        .map(|i| {
            let [u, v, w] = [0, 1, 2].map(|c| hash(3 * i + c + 0x9e37_79b9));
            let (height, angle) = (u, v * std::f32::consts::TAU);
            let ring = (1.0 - height * height).sqrt();
            let share = i as f32 / samples as f32;
            Vec3::new(ring * angle.cos(), ring * angle.sin(), height) * w * (0.1 + 0.9 * share * share)
        })
        .collect()
}

/// Uniform in [0, 1) of an integer (PCG's output permutation).
fn hash(value: u32) -> f32 {
    let state = value.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (((word >> 22) ^ word) >> 8) as f32 / (1 << 24) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::view::StereoRig;

    const SIZE: [usize; 2] = [96, 96];
    const SETTINGS: Settings = Settings { radius_mm: 8.0, samples: 64, bias_mm: 0.2 };

    fn rig() -> StereoRig {
        StereoRig {
            position: Vec3::new(0.0, 0.0, 100.0),
            target: Vec3::ZERO,
            up: Vec3::Y,
            ipd_mm: 12.0,
            fov_deg: 30.0,
            screen_mm: None,
        }
    }

    /// Distance along a ray to a scene: the plane z = 0, and on it balls of radius 6 if asked for.
    fn cast(origin: Vec3, direction: Vec3, balls: bool) -> f32 {
        let mut nearest = -origin.z / direction.z;
        if balls {
            for (x, y) in [(-12.0, -12.0), (-12.0, 12.0), (12.0, -12.0), (12.0, 12.0), (0.0, 0.0)] {
                let to = origin - Vec3::new(x, y, 4.0);
                let (a, b, c) = (direction.dot(direction), direction.dot(to), to.dot(to) - 36.0);
                let root = b * b - a * c;
                if root >= 0.0 {
                    nearest = nearest.min((-b - root.sqrt()) / a);
                }
            }
        }
        nearest
    }

    fn depth_image(view: &View, balls: bool) -> Vec<f32> {
        (0..SIZE[0] * SIZE[1])
            .map(|i| {
                let uv = Vec2::new((i % SIZE[0]) as f32 + 0.5, (i / SIZE[0]) as f32 + 0.5);
                let (origin, direction) = view.ray(uv / Vec2::new(SIZE[0] as f32, SIZE[1] as f32));
                let distance = cast(origin, direction, balls);
                view.project(origin + direction * distance).unwrap().1
            })
            .collect()
    }

    #[test]
    fn a_plane_is_not_occluded_and_a_corner_is() {
        let [view, _] = rig().views(1.0, 10.0, 200.0).unwrap();
        let plane = ssao(&depth_image(&view, false), SIZE, &view, &SETTINGS);
        assert!(plane.iter().all(|&a| a > 0.999));
        let balls = ssao(&depth_image(&view, true), SIZE, &view, &SETTINGS);
        assert!(balls.iter().all(|a| (0.0..=1.0).contains(a)));
        assert!(balls.iter().filter(|&&a| a < 0.8).count() > 100);
    }

    #[test]
    fn nothing_drawn_is_not_occluded() {
        let [view, _] = rig().views(1.0, 10.0, 200.0).unwrap();
        assert_eq!(ssao(&[1.0; 96 * 96], SIZE, &view, &SETTINGS), [1.0; 96 * 96]);
    }

    /// World points that both eyes see: their shading differs, which is what the consistency test has to notice.
    #[test]
    fn the_eyes_disagree_about_the_same_point() {
        let [left, right] = rig().views(1.0, 10.0, 200.0).unwrap();
        let depths = [&left, &right].map(|view| depth_image(view, true));
        let shaded = [ssao(&depths[0], SIZE, &left, &SETTINGS), ssao(&depths[1], SIZE, &right, &SETTINGS)];
        let (mut sum, mut count) = (0.0, 0);
        for i in 0..depths[0].len() {
            let Some(point) = unproject(depths[0][i], SIZE, &left, i) else { continue };
            let world = left.position + left.orientation * point;
            let Some((uv, depth)) = right.project(world) else { continue };
            let place = uv * Vec2::new(SIZE[0] as f32, SIZE[1] as f32);
            if place.cmplt(Vec2::ZERO).any() || place.cmpge(Vec2::splat(SIZE[0] as f32)).any() {
                continue;
            }
            let j = place.y as usize * SIZE[0] + place.x as usize;
            // The same point, not one that hides it from the right eye.
            if (depths[1][j] - depth).abs() < 2e-4 {
                sum += (shaded[0][i] - shaded[1][j]).abs();
                count += 1;
            }
        }
        let mean = sum / count as f32;
        assert!(count > 4000 && mean > 0.005, "{mean} over {count}");
    }
}
