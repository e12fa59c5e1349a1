//! Faces of more than three corners as triangles, concave ones too (ear clipping, the crate `earcut`).
//!
//! Whatever the ears are, the triangles together have the face's own edges as their border, each in its direction and with its every
//! corner, so that a closed mesh stays closed.

use earcut::Earcut;
use glam::{DVec2, DVec3, Vec3};
use std::collections::{BTreeMap, HashMap};

/// Share of a face's area that its triangles may miss or count twice.
const ROUNDING: f64 = 1e-6;

/// Triangles of the face with these corners, as indices into them, in its sense of rotation. Seen along its normal, the face may touch
/// itself and be concave; it need not be flat. One without area becomes triangles without area. The error says what is wrong with it.
pub fn triangles(corners: &[Vec3]) -> Result<Vec<[usize; 3]>, String> {
    let fan = || (2..corners.len()).map(|i| [0, i - 1, i]).collect();
    if corners.is_empty() {
        return Err("a face without corners".into());
    }
    if corners.len() <= 3 {
        return Ok(fan());
    }
    // About the first corner and of size 1, so that nothing overflows and few digits are lost.
    let about = |p: &Vec3| p.as_dvec3() - corners[0].as_dvec3();
    let size = corners.iter().map(|p| about(p).abs().max_element()).fold(0.0, f64::max);
    if size == 0.0 {
        return Ok(fan());
    }
    let points: Vec<DVec3> = corners.iter().map(|p| about(p) / size).collect();
    let next = |i: usize| points[(i + 1) % points.len()];
    let shares: Vec<DVec3> = (0..points.len()).map(|i| points[i].cross(next(i))).collect();
    // Twice the area, along the normal.
    let area: DVec3 = shares.iter().sum();
    let spread: f64 = shares.iter().map(|share| share.length()).sum();
    if spread <= 1e-12 {
        return Ok(fan());
    }
    let crosses = || "the face crosses itself, seen along its normal; cut it into triangles".to_owned();
    if area.length() <= ROUNDING * spread {
        return Err(crosses());
    }
    let (right, up) = area.normalize().any_orthonormal_pair();
    let flat: Vec<[f64; 2]> = points.iter().map(|p| [p.dot(right), p.dot(up)]).collect();
    let twice = |[a, b, c]: [usize; 3]| {
        let [a, b, c] = [a, b, c].map(|i| DVec2::from_array(flat[i]));
        (b - a).perp_dot(c - a)
    };

    let mut ears: Vec<u32> = Vec::new();
    Earcut::new().earcut_slice(&flat, &[], &mut ears);
    let ears = ears.chunks_exact(3).map(|t| [t[0] as usize, t[1] as usize, t[2] as usize]);
    let turned = ears.map(|[a, b, c]| if twice([a, b, c]) < 0.0 { [a, c, b] } else { [a, b, c] });
    // Corners at one place are one; ears may have taken any of them.
    let mut first = HashMap::new();
    let one: Vec<usize> = (0..corners.len())
        .map(|i| *first.entry((corners[i] + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert(i))
        .collect();
    let mut found: Vec<[usize; 3]> = turned.map(|t| t.map(|i| one[i])).collect();
    let seams = seams(&one, &found);
    found.extend(seams);
    let covered: f64 = found.iter().map(|&t| twice(t).abs()).sum();
    match (covered - area.length()).abs() <= ROUNDING * area.length() {
        true => Ok(found),
        false => Err(crosses()),
    }
}

/// Triangles between the border of the face and that of its ears, which leave out corners on a straight line.
fn seams(face: &[usize], ears: &[[usize; 3]]) -> Vec<[usize; 3]> {
    let mut balance: BTreeMap<(usize, usize), isize> = BTreeMap::new();
    let mut add = |from: usize, to: usize, sign: isize| {
        if from != to {
            *balance.entry((from.min(to), from.max(to))).or_default() += if from < to { sign } else { -sign };
        }
    };
    (0..face.len()).for_each(|i| add(face[i], face[(i + 1) % face.len()], 1));
    ears.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).for_each(|(from, to)| add(from, to, -1));
    // What is left over has no end: from each corner as many edges go as come.
    let mut leaving: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for ((low, high), count) in balance {
        let (from, to) = if count > 0 { (low, high) } else { (high, low) };
        (0..count.unsigned_abs()).for_each(|_| leaving.entry(from).or_default().push(to));
    }
    let mut found = Vec::new();
    while let Some((&start, _)) = leaving.first_key_value() {
        let mut at = start;
        while let Some(ends) = leaving.get_mut(&at) {
            let to = ends.pop();
            if ends.is_empty() {
                leaving.remove(&at);
            }
            let Some(to) = to else { break };
            if at != start && to != start {
                found.push([start, at, to]);
            }
            at = to;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Area along z that the triangles cover, each with its sign and without.
    fn areas(corners: &[Vec3], found: &[[usize; 3]]) -> [f32; 2] {
        let each = |&[a, b, c]: &[usize; 3]| 0.5 * (corners[b] - corners[a]).cross(corners[c] - corners[a]).z;
        [found.iter().map(each).sum(), found.iter().map(|t| each(t).abs()).sum()]
    }

    /// The border of the triangles is the face's, edge by edge.
    fn assert_border(corners: &[Vec3], found: &[[usize; 3]]) {
        let place = |i: usize| corners.iter().position(|p| *p == corners[i]).unwrap();
        let mut balance = HashMap::new();
        let mut add = |from: usize, to: usize, sign: i32| {
            let (from, to) = (place(from), place(to));
            *balance.entry((from.min(to), from.max(to))).or_insert(0) +=
                if from < to { sign } else { -sign } * i32::from(from != to);
        };
        (0..corners.len()).for_each(|i| add(i, (i + 1) % corners.len(), 1));
        found.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).for_each(|(a, b)| add(a, b, -1));
        assert!(balance.values().all(|&count| count == 0), "{corners:?}: {found:?}");
    }

    fn flat(corners: &[(i16, i16)]) -> Vec<Vec3> {
        corners.iter().map(|&(x, y)| Vec3::new(x.into(), y.into(), 0.0)).collect()
    }

    #[test]
    fn concave_faces_are_covered_once_from_any_corner_in_any_sense() {
        for (face, area) in [
            // An L, a comb, a square with corners on its sides, a face that touches itself at a corner, a ring with a slit.
            (flat(&[(0, 0), (4, 0), (4, 1), (1, 1), (1, 4), (0, 4)]), 7.0),
            (
                flat(&[
                    (0, 0),
                    (7, 0),
                    (7, 3),
                    (6, 3),
                    (6, 1),
                    (4, 1),
                    (4, 3),
                    (3, 3),
                    (3, 1),
                    (1, 1),
                    (1, 3),
                    (0, 3),
                ]),
                13.0,
            ),
            (flat(&[(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)]), 4.0),
            (flat(&[(0, 0), (2, 0), (2, 2), (4, 2), (4, 4), (2, 4), (2, 2), (0, 2)]), 8.0),
            (flat(&[(0, 0), (3, 0), (3, 3), (0, 3), (0, 0), (1, 1), (1, 2), (2, 2), (2, 1), (1, 1)]), 8.0),
        ] {
            for start in 0..face.len() {
                for turned in [false, true] {
                    let mut corners = face.clone();
                    corners.rotate_left(start);
                    if turned {
                        corners.reverse();
                    }
                    let found = triangles(&corners).unwrap_or_else(|e| panic!("{corners:?}: {e}"));
                    let sign = if turned { -1.0 } else { 1.0 };
                    assert_eq!(areas(&corners, &found), [sign * area, area], "{corners:?}: {found:?}");
                    assert_border(&corners, &found);
                }
            }
        }
    }

    #[test]
    fn faces_that_are_not_flat_keep_their_border() {
        let mut star: Vec<Vec3> = (0..40)
            .map(|i| {
                let (angle, radius) =
                    (i as f32 * std::f32::consts::TAU / 40.0, if i % 2 == 0 { 1.0 } else { 0.3 });
                Vec3::new(radius * angle.cos(), radius * angle.sin(), 0.05 * (i % 5) as f32)
            })
            .collect();
        for _ in 0..star.len() {
            star.rotate_left(1);
            assert_border(&star, &triangles(&star).unwrap());
        }
    }

    #[test]
    fn faces_without_area_keep_their_border_and_those_that_cross_themselves_are_refused() {
        for face in [
            flat(&[(0, 0), (1, 0), (2, 0), (1, 0)]),
            flat(&[(3, 3); 5]),
            flat(&[(0, 0), (4, 0), (2, 0), (9, 0)]),
        ] {
            assert_border(&face, &triangles(&face).unwrap());
        }
        let bow = flat(&[(0, 0), (2, 2), (2, 0), (0, 2)]);
        let uneven = flat(&[(0, 0), (3, 3), (3, 0), (0, 1)]);
        let star = flat(&[(0, 30), (18, -24), (-29, 9), (29, 9), (-18, -24)]);
        for face in [bow, uneven, star] {
            assert!(triangles(&face).unwrap_err().contains("crosses itself"), "{face:?}");
        }
    }
}
