//! The line sweep of method.md §4 as plain SIMD code on the processor's cores: what the kernels are measured against.
//!
//! A *line* is the set of voxels x + j·v of one lattice direction v. Its segment from one voxel to the next maps what comes in,
//! (transmittance, sum), by an affine pair (t, s): T' = t·T, S' = S + s·T. The ambient value along v at a voxel is the S of
//! the W segments that begin there, divided by W; opacity outside the volume is 0. A sliding window over a line needs three
//! compositions a voxel, whatever W is (van Herk 1992, Gil & Werman 1993): the line is cut into blocks of W, and a window is
//! the rest of one block, from a scan backwards, and the beginning of the next, from a scan forwards. The line and its
//! reverse share their segments and both scans: the reverse needs the same two with the parts exchanged.
//!
//! What makes it fast here: `LANES` neighbouring lines at once, side by side along x (along y for the lines along x), in
//! loops that the compiler turns into vector instructions, compiled for each of [`Vectors`]; lines are cut to their part
//! inside the volume; a plane of rows is fetched once for all lines that stay in it; logarithms are taken once a voxel (a
//! table of λ was not needed: the two divisions of a segment cost more); every thread has a sum of its own, so that none waits.
//! Blocks lie at multiples of W, so a value does not depend on the length of its line.

use std::thread;

/// Lines worked on together.
const LANES: usize = 16;

/// A value for each of them.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Lanes([f32; LANES]);

/// Below this q = 1 − a counts as opaque where both ends of a segment are, as in `cao_twin::cast::lao`.
const OPAQUE: f32 = 1e-6;

/// How a segment's pair follows from q = 1 − a at its ends (method.md §3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// CAO eq. (2): t = q^Δ of the far end, s = 1.
    Left,
    /// Opacity linear between the ends: t = exp(−Δλ), s = (1 − t)/(Δλ), λ the mean of −ln q.
    Segment,
}

/// A direction and its reverse.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// Lattice vector, components −1, 0 or 1; the last that is not 0 is 1.
    pub v: [i32; 3],
    /// Weight of each of the two.
    pub weight: f32,
    /// Δ: length of a segment in reference lengths of the opacity.
    pub length: f32,
    /// W: segments of a ray.
    pub window: usize,
}

/// The lines of a ray set with both signs of every direction, from lattice vectors and weights.
pub fn lines(
    rays: &[([i32; 3], f64)],
    length: impl Fn([i32; 3]) -> f32,
    window: impl Fn([i32; 3]) -> usize,
) -> Vec<Line> {
    let forward = |v: &[i32; 3]| v.iter().rev().find(|c| **c != 0) == Some(&1);
    rays.iter()
        .filter(|(v, _)| forward(v))
        .map(|&(v, weight)| Line { v, weight: weight as f32, length: length(v), window: window(v) })
        .collect()
}

/// Σ_k w_k S_k/W_k over all directions, x fastest. `q` holds 1 − a, each in 0 … 1.
pub fn sweep(
    dims: [usize; 3],
    q: &[f32],
    lines: &[Line],
    rule: Rule,
    vectors: Vectors,
    threads: usize,
) -> Vec<f32> {
    let (rows, stride) = (dims[1] * dims[2], dims[0] + LANES);
    // A margin of LANES on both sides of every row, shared by neighbours, where q = 1.
    let padded = 2 * LANES + rows * stride;
    let share = rows.div_ceil(threads).max(1);

    // For the left sum a volume of q^Δ for each length, for the segment rule one of ln q.
    let mut lengths: Vec<f32> = match rule {
        Rule::Left => lines.iter().map(|line| line.length).collect(),
        Rule::Segment => vec![0.0],
    };
    lengths.sort_by(f32::total_cmp);
    lengths.dedup();
    let mut clear = vec![1.0; padded];
    let mut others = vec![vec![if rule == Rule::Left { 1.0 } else { 0.0 }; padded]; lengths.len()];
    thread::scope(|scope| {
        let mut parts: Vec<_> = others.iter_mut().map(|o| o[LANES..].chunks_mut(share * stride)).collect();
        for (q, clear) in q.chunks(share * dims[0]).zip(clear[LANES..].chunks_mut(share * stride)) {
            let others: Vec<_> = parts.iter_mut().filter_map(Iterator::next).collect();
            let lengths = &lengths;
            scope.spawn(move || vectors.run(Prepare { width: dims[0], rule, lengths, q, clear, others }));
        }
    });

    // Lines that differ in x only lie in the same planes, which are fetched once.
    let mut families: Vec<Vec<Line>> = Vec::new();
    for line in lines {
        match families.iter_mut().find(|family| family[0].v[1..] == line.v[1..]) {
            Some(family) => family.push(*line),
            None => families.push(vec![*line]),
        }
    }
    let mut sums: Vec<Vec<f32>> = thread::scope(|scope| {
        let workers: Vec<_> = (0..threads)
            .map(|first| {
                let (clear, others, lengths) = (&clear, &others, &lengths);
                let families = &families;
                scope.spawn(move || {
                    let mut sum = vec![0.0; padded];
                    for lines in families {
                        let sum = sum.as_mut_slice();
                        let step = threads;
                        vectors.run(Planes { dims, lines, rule, lengths, clear, others, first, step, sum });
                    }
                    sum
                })
            })
            .collect();
        workers.into_iter().map(|worker| worker.join().expect("a worker panicked")).collect()
    });

    let mut ambient = vec![0.0; q.len()];
    let rest = sums.split_off(1);
    thread::scope(|scope| {
        for (part, out) in ambient.chunks_mut(share * dims[0]).enumerate() {
            let (sums, rest) = (&sums, &rest);
            scope.spawn(move || {
                for (row, out) in out.chunks_mut(dims[0]).enumerate() {
                    let at = LANES + (part * share + row) * stride;
                    out.copy_from_slice(&sums[0][at..at + dims[0]]);
                    for sum in rest {
                        out.iter_mut().zip(&sum[at..]).for_each(|(out, sum)| *out += sum);
                    }
                }
            });
        }
    });
    ambient
}

/// Work that is compiled for the best vector instructions at hand.
trait Work {
    fn run<const FUSED: bool>(self);
}

/// Instructions to compile for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vectors {
    /// What the build's target has, on x86-64 SSE2: 4 lanes, no fused multiply-add.
    Target,
    /// 8 lanes, fused.
    Avx2,
    /// 16 lanes, fused.
    Avx512,
}

impl Vectors {
    /// Those that this processor has, the widest last.
    pub fn available() -> Vec<Self> {
        #[allow(unused_mut, reason = "other processors have one")]
        let mut list = vec![Self::Target];
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            list.push(Self::Avx2);
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl") {
                list.push(Self::Avx512);
            }
        }
        list
    }

    fn run(self, work: impl Work) {
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx512f,avx512vl,avx2,fma")]
            fn avx512(work: impl Work) {
                work.run::<true>();
            }
            #[target_feature(enable = "avx2,fma")]
            fn avx2(work: impl Work) {
                work.run::<true>();
            }
            match self {
                // SAFETY: asked just before whether the processor has these instructions.
                Self::Avx512 if Self::available().contains(&self) => return unsafe { avx512(work) },
                // SAFETY: as above.
                Self::Avx2 if Self::available().contains(&self) => return unsafe { avx2(work) },
                _ => {}
            }
        }
        work.run::<false>();
    }
}

/// Copies rows into padded volumes, with their powers or logarithms.
struct Prepare<'a> {
    width: usize,
    rule: Rule,
    lengths: &'a [f32],
    q: &'a [f32],
    clear: &'a mut [f32],
    others: Vec<&'a mut [f32]>,
}

impl Work for Prepare<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Self { width, rule, lengths, q, clear, mut others } = self;
        for (row, q) in q.chunks_exact(width).enumerate() {
            let at = row * (width + LANES);
            clear[at..at + width].copy_from_slice(q);
            for (other, length) in others.iter_mut().zip(lengths) {
                let out = &mut other[at..at + width];
                match rule {
                    Rule::Left if *length == 1.0 => out.copy_from_slice(q),
                    Rule::Left => {
                        for (out, q) in out.iter_mut().zip(q) {
                            let power = exp::<FUSED>(length * ln::<FUSED>(*q));
                            *out = if *q > 0.0 { power } else { 0.0 };
                        }
                    }
                    Rule::Segment => {
                        out.iter_mut().zip(q).for_each(|(out, q)| *out = ln::<FUSED>(*q));
                    }
                }
            }
        }
    }
}

/// Sweeps a family of lines in every `step`-th plane from `first`.
struct Planes<'a> {
    dims: [usize; 3],
    /// They differ in x only.
    lines: &'a [Line],
    rule: Rule,
    lengths: &'a [f32],
    clear: &'a [f32],
    /// For each length q^Δ, or ln q.
    others: &'a [Vec<f32>],
    first: usize,
    step: usize,
    sum: &'a mut [f32],
}

impl Work for Planes<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        match self.rule {
            Rule::Left => self.planes::<FUSED, true>(),
            Rule::Segment => self.planes::<FUSED, false>(),
        }
    }
}

impl Planes<'_> {
    #[inline(always)]
    fn planes<const FUSED: bool, const LEFT: bool>(mut self) {
        let [nx, ny, nz] = self.dims.map(|d| d as i32);
        let [_, vy, vz] = self.lines[0].v;
        let longest = self.lines.iter().map(|line| line.window).max().unwrap_or(0);
        let mut scratch = Scratch::new(self.dims, longest);
        let planes = if vz == 0 { nz } else { ny + vy.abs() * (nz - 1) };
        for plane in (self.first as i32..planes).step_by(self.step) {
            if vz == 0 && vy == 0 {
                for y in (0..ny).step_by(LANES) {
                    self.along_x::<FUSED, LEFT>(&mut scratch, y as usize, plane as usize);
                }
                continue;
            }
            // Row p of the plane is y0 + p·vy of slice p, or row p of slice `plane`.
            let y0 = plane - if vz == 1 && vy == 1 { nz - 1 } else { 0 };
            let (begin, end) = match (vz, vy) {
                (0, _) => (0, ny),
                (_, 0) => (0, nz),
                (_, 1) => ((-y0).max(0), (ny - y0).min(nz)),
                _ => ((y0 - ny + 1).max(0), (y0 + 1).min(nz)),
            };
            // The plane's rows one after the other in the second cache, with a margin on both sides.
            let start = |p: i32| {
                let row = if vz == 0 { plane * ny + p } else { p * ny + y0 + p * vy };
                row as usize * (self.dims[0] + LANES)
            };
            let width = self.dims[0] + 2 * LANES;
            let fetch = |from: &[f32], to: &mut Vec<f32>| {
                to.clear();
                (begin..end).for_each(|p| to.extend_from_slice(&from[start(p)..start(p) + width]));
            };
            if !LEFT {
                fetch(self.clear, &mut scratch.plane_clear);
            }
            fetch(self.sum, &mut scratch.plane_sum);
            let mut fetched = None;
            for line in self.lines {
                let other = self.other(line);
                if fetched != Some(other) {
                    fetch(&self.others[other], &mut scratch.plane_other);
                    fetched = Some(other);
                }
                // The first line of a group lies at x0 + p·vx in row p.
                let vx = line.v[0];
                let (low, high) = match vx {
                    0 => (0, nx),
                    1 => (1 - end, nx - begin),
                    _ => (begin, nx + end - 1),
                };
                for x0 in (low..high).step_by(LANES) {
                    let lanes = LANES as i32;
                    let (from, to) = match vx {
                        0 => (begin, end),
                        1 => (begin.max(1 - lanes - x0), end.min(nx - x0)),
                        _ => (begin.max(x0 - nx + 1), end.min(x0 + lanes)),
                    };
                    if from < to {
                        let at = |p: i32| ((p - begin) * width as i32 + lanes + x0 + p * vx) as usize;
                        group::<FUSED, LEFT>(&mut scratch, at, from, to, line);
                    }
                }
            }
            for (p, sum) in (begin..end).zip(scratch.plane_sum.chunks_exact(width)) {
                let at = start(p) + LANES;
                self.sum[at..at + self.dims[0]].copy_from_slice(&sum[LANES..width - LANES]);
            }
        }
    }

    /// Number of the volume that these lines read beside q.
    fn other(&self, line: &Line) -> usize {
        self.lengths.iter().position(|length| *length == line.length).unwrap_or(0)
    }

    /// Lines along x from y on, side by side along y; in squares that fit registers.
    #[inline(always)]
    fn along_x<const FUSED: bool, const LEFT: bool>(&mut self, scratch: &mut Scratch, y: usize, z: usize) {
        let [nx, ny, _] = self.dims;
        let count = LANES.min(ny - y);
        let line = &self.lines[0];
        let other = &self.others[self.other(line)];
        let row = |lane: usize| LANES + (z * ny + y + lane.min(count - 1)) * (nx + LANES);
        for x in (0..nx).step_by(LANES) {
            for lane in 0..LANES {
                turn(&other[row(lane) + x..], &mut scratch.other[x + 1..], lane);
                if !LEFT {
                    turn(&self.clear[row(lane) + x..], &mut scratch.clear[x + 1..], lane);
                }
            }
        }
        scan::<FUSED, LEFT>(scratch, 0, nx as i32, line);
        let scale = Lanes([line.weight / line.window as f32; LANES]);
        for x in (0..nx).step_by(LANES) {
            for lane in 0..count {
                // What lies beyond the row's end goes to the margin, which nobody reads.
                let mut ambient = ONE;
                for (to, from) in ambient.0.iter_mut().zip(&scratch.ambient[x + 1..][..LANES]) {
                    *to = from.0[lane];
                }
                let at = row(lane) + x;
                let sum: &mut [f32; LANES] = (&mut self.sum[at..at + LANES]).try_into().expect("as many");
                *sum = madd::<FUSED>(ambient, scale, Lanes(*sum)).0;
            }
        }
    }
}

/// Lines whose voxels at p lie side by side from `at(p)` in the plane.
#[inline(always)]
fn group<const FUSED: bool, const LEFT: bool>(
    scratch: &mut Scratch,
    at: impl Fn(i32) -> usize,
    from: i32,
    to: i32,
    line: &Line,
) {
    for (k, p) in (from..to).enumerate() {
        scratch.other[k + 1] = lanes(&scratch.plane_other, at(p));
        if !LEFT {
            scratch.clear[k + 1] = lanes(&scratch.plane_clear, at(p));
        }
    }
    scan::<FUSED, LEFT>(scratch, from, to, line);
    let scale = Lanes([line.weight / line.window as f32; LANES]);
    for (k, p) in (from..to).enumerate() {
        let sum = madd::<FUSED>(scratch.ambient[k + 1], scale, lanes(&scratch.plane_sum, at(p)));
        scratch.plane_sum[at(p)..at(p) + LANES].copy_from_slice(&sum.0);
    }
}

/// Neighbours in a row.
#[inline(always)]
fn lanes(row: &[f32], at: usize) -> Lanes {
    Lanes(row[at..at + LANES].try_into().expect("as many"))
}

/// Writes a row into one lane of a column.
#[inline(always)]
fn turn(from: &[f32], to: &mut [Lanes], lane: usize) {
    for (to, from) in to[..LANES].iter_mut().zip(&from[..LANES]) {
        to.0[lane] = *from;
    }
}

/// Arrays along a group of lines. Entry k of a line's arrays is its voxel (or the segment from it to the next) at
/// position `from` − 1 + k.
struct Scratch {
    /// Rows of a plane, and the sum so far.
    plane_clear: Vec<f32>,
    plane_other: Vec<f32>,
    plane_sum: Vec<f32>,
    clear: Vec<Lanes>,
    /// q^Δ for the left sum, else ln q.
    other: Vec<Lanes>,
    t: Vec<Lanes>,
    s: Vec<Lanes>,
    /// Sum of both directions.
    ambient: Vec<Lanes>,
    /// For each place in a block: the pair of its segments from there on, …
    rest_t: Vec<Lanes>,
    rest_s: Vec<Lanes>,
    /// … and the sum of a ray that comes back from the block's end to there.
    back: Vec<Lanes>,
}

impl Scratch {
    fn new(dims: [usize; 3], window: usize) -> Self {
        let longest = dims.into_iter().max().unwrap_or(0);
        // Lines along x are read in whole squares.
        let line = || vec![Lanes([1.0; LANES]); longest.next_multiple_of(LANES) + 2];
        let block = || vec![Lanes([0.0; LANES]); window];
        Self {
            plane_clear: Vec::new(),
            plane_other: Vec::new(),
            plane_sum: Vec::new(),
            clear: line(),
            other: line(),
            t: line(),
            s: line(),
            ambient: line(),
            rest_t: block(),
            rest_s: block(),
            back: block(),
        }
    }
}

/// S of both directions at the positions `from … to − 1`; q is 1 before and after.
#[inline(always)]
fn scan<const FUSED: bool, const LEFT: bool>(scratch: &mut Scratch, from: i32, to: i32, line: &Line) {
    let w = line.window as i32;
    let count = (to - from) as usize;
    let outside = if LEFT { 1.0 } else { 0.0 };
    let Scratch { clear, other, t, s, ambient, rest_t, rest_s, back, .. } = scratch;
    other[0].0 = [outside; LANES];
    other[count + 1].0 = [outside; LANES];
    if !LEFT {
        clear[0].0 = [1.0; LANES];
        clear[count + 1].0 = [1.0; LANES];
        for k in 0..=count {
            let (q, ln) = ([&clear[k], &clear[k + 1]], [&other[k], &other[k + 1]]);
            segments::<FUSED>(line.length, q, ln, &mut t[k], &mut s[k]);
        }
    }
    // Pair of segment k forwards, and its t backwards. The left sum's transmittance is that of the voxel which is reached.
    let pair = |k: usize| if LEFT { (other[k + 1], ONE, other[k]) } else { (t[k], s[k], t[k]) };

    let (first, last) = (from.div_euclid(w), (to - 1).div_euclid(w));
    // What lies before the line's first block: at most its first segment, the rest is clear.
    for (i, back) in back.iter_mut().take(line.window).enumerate() {
        let left = (line.window - i) as f32;
        *back = Lanes([left; LANES]);
        if from == first * w {
            let (_, s, reverse) = pair(0);
            *back = madd::<FUSED>(reverse, Lanes([left - 1.0; LANES]), s);
        }
    }
    for block in first..=last + 1 {
        let base = block * w;
        let low = (from - 1 - base).max(0);
        let inside = (to - base).clamp(0, w);

        // Forwards: the beginning of this block completes the rays that start in the one before, and what lies behind
        // completes the rays that go backwards from here.
        let (mut run_t, mut run_s) = (ONE, Lanes([low as f32; LANES]));
        let (mut behind_t, mut behind_s) = (run_t, run_s);
        for i in low..inside {
            let p = base + i;
            let (k, j) = ((p - from + 1) as usize, i as usize);
            if block > first && p - w >= from {
                let ahead = madd::<FUSED>(rest_t[j], run_s, rest_s[j]);
                ambient[k - line.window] = plus(ambient[k - line.window], ahead);
            }
            if p >= from {
                ambient[k] = madd::<FUSED>(behind_t, back[j], behind_s);
            }
            let (t, s, reverse) = pair(k);
            run_s = madd::<FUSED>(run_t, s, run_s);
            run_t = times(run_t, t);
            behind_s = madd::<FUSED>(reverse, behind_s, s);
            behind_t = times(behind_t, reverse);
        }
        if block > first {
            for i in inside..w.min(to - base + w) {
                let p = base + i;
                if p - w >= from {
                    let (k, j) = ((p - from + 1 - w) as usize, i as usize);
                    ambient[k] = plus(ambient[k], madd::<FUSED>(rest_t[j], run_s, rest_s[j]));
                }
                run_s = plus(run_s, run_t);
            }
        }
        if block > last {
            break;
        }

        // Backwards: the rest of this block from each place on, and a ray that comes back from its end.
        let (mut whole_t, mut whole_s) = (ONE, Lanes([(w - inside) as f32; LANES]));
        let (mut back_t, mut back_s) = (whole_t, whole_s);
        for i in (low..inside).rev() {
            let j = i as usize;
            let (t, s, reverse) = pair((base + i - from + 1) as usize);
            whole_s = madd::<FUSED>(t, whole_s, s);
            whole_t = times(whole_t, t);
            back_s = madd::<FUSED>(back_t, s, back_s);
            back_t = times(back_t, reverse);
            rest_t[j] = whole_t;
            rest_s[j] = whole_s;
            back[j] = back_s;
        }
        for i in (0..low).rev() {
            back_s = plus(back_s, back_t);
            back[i as usize] = back_s;
        }
    }
}

const ONE: Lanes = Lanes([1.0; LANES]);

/// a·b + c.
#[inline(always)]
fn madd<const FUSED: bool>(a: Lanes, b: Lanes, c: Lanes) -> Lanes {
    let mut out = c;
    for l in 0..LANES {
        out.0[l] = fused::<FUSED>(a.0[l], b.0[l], c.0[l]);
    }
    out
}

#[inline(always)]
fn times(a: Lanes, b: Lanes) -> Lanes {
    let mut out = a;
    for l in 0..LANES {
        out.0[l] *= b.0[l];
    }
    out
}

#[inline(always)]
fn plus(a: Lanes, b: Lanes) -> Lanes {
    let mut out = a;
    for l in 0..LANES {
        out.0[l] += b.0[l];
    }
    out
}

/// Pairs of the segments from one voxel to the next, method.md §3.
#[inline(always)]
fn segments<const FUSED: bool>(length: f32, q: [&Lanes; 2], ln: [&Lanes; 2], t: &mut Lanes, s: &mut Lanes) {
    let ([q0, q1], [l0, l1]) = (q.map(|q| q.0), ln.map(|l| l.0));
    let (mut ts, mut ss) = ([0.0; LANES], [0.0; LANES]);
    for l in 0..LANES {
        (ts[l], ss[l]) = segment::<FUSED>(length, q0[l], q1[l], l0[l], l1[l]);
    }
    (t.0, s.0) = (ts, ss);
}

/// (t, s) of a segment, s as a share of its length.
///
/// With a = (ln q1 − ln q0)/2 and the geometric mean g of q0 and q1, λ = 1 − (q1 ln q1 − q0 ln q0)/(q1 − q0) is
/// −ln g + 1 − a coth a, whose series holds where the quotient would cancel.
#[inline(always)]
fn segment<const FUSED: bool>(length: f32, q0: f32, q1: f32, l0: f32, l1: f32) -> (f32, f32) {
    let a = 0.5 * (l1 - l0);
    let a2 = a * a;
    // 1 − a coth a; the next term is 2a¹⁰/93555, at a = ½ 2e-8.
    let p = fused::<FUSED>(a2, 1.0 / 4725.0, -2.0 / 945.0);
    let p = fused::<FUSED>(a2, p, 1.0 / 45.0);
    let p = fused::<FUSED>(a2, p, -1.0 / 3.0);
    let near = fused::<FUSED>(a2, p, -0.5 * (l0 + l1));
    let far = 1.0 - (q1 * l1 - q0 * l0) / (q1 - q0);
    let mean = if a2 < 0.25 { near } else { far };

    let x = length * mean;
    let b = exp::<FUSED>(-x);
    // (1 − e^−x)/x; the next term is x⁶/5040, at x = ¼ 5e-8.
    let p = fused::<FUSED>(x, -1.0 / 720.0, 1.0 / 120.0);
    let p = fused::<FUSED>(x, -p, 1.0 / 24.0);
    let p = fused::<FUSED>(x, -p, 1.0 / 6.0);
    let p = fused::<FUSED>(x, -p, 0.5);
    let thin = fused::<FUSED>(x, -p, 1.0);
    let thick = (1.0 - b) / x;
    let share = if x < 0.25 { thin } else { thick };
    let opaque = q0.max(q1) < OPAQUE;
    (if opaque { 0.0 } else { b }, if opaque { 0.0 } else { share })
}

/// a·b + c, in one rounding where the processor can: elsewhere that would be a call of a library.
#[inline(always)]
fn fused<const FUSED: bool>(a: f32, b: f32, c: f32) -> f32 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// ln q to a few 1e-7, for q ≥ 0; of 0 a large negative number. Cephes' `logf`, without branches.
#[inline(always)]
fn ln<const FUSED: bool>(q: f32) -> f32 {
    let bits = q.max(1e-30).to_bits().wrapping_sub(SQRT_HALF);
    let exponent = ((bits as i32) >> 23) as f32;
    let f = f32::from_bits((bits & 0x007f_ffff).wrapping_add(SQRT_HALF)) - 1.0;
    let mut p = 7.037_683_6e-2;
    for c in [
        -1.151_461e-1,
        1.167_699_9e-1,
        -1.242_014_1e-1,
        1.424_932_3e-1,
        -1.666_805_8e-1,
        2.000_071_4e-1,
        -2.499_999_4e-1,
        0.333_333_3,
    ] {
        p = fused::<FUSED>(p, f, c);
    }
    let square = f * f;
    let rest = fused::<FUSED>(p * f, square, -2.121_944_4e-4 * exponent);
    let rest = fused::<FUSED>(square, -0.5, rest);
    fused::<FUSED>(exponent, 0.693_359_4, f + rest)
}

const SQRT_HALF: u32 = 0x3f35_04f3;

/// e^x to a few 1e-7, for x ≤ 0; at least e^−87. Cephes' `expf`, without branches.
#[inline(always)]
fn exp<const FUSED: bool>(x: f32) -> f32 {
    // Adding it leaves the nearest integer in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    let x = x.max(-87.0);
    let shifted = fused::<FUSED>(x, std::f32::consts::LOG2_E, ROUND);
    let n = shifted - ROUND;
    let r = fused::<FUSED>(n, -0.693_359_4, x);
    let r = fused::<FUSED>(n, 2.121_944_4e-4, r);
    let mut p = 1.987_569_2e-4;
    for c in [1.398_2e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 0.5] {
        p = fused::<FUSED>(p, r, c);
    }
    let p = fused::<FUSED>(p * r, r, r + 1.0);
    f32::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 23))
}
