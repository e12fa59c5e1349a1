//! A bounding volume hierarchy: which of many boxes a ray crosses, or a point lies in, without looking at all of them.
//!
//! Built by the surface area heuristic over bins (Wald 2007): of the cuts across each axis the one with the least
//! `area(left)·count(left) + area(right)·count(right)`. Nodes lie depth first, each with the node to go on with where it is missed, so that
//! whoever walks needs no stack: `i = if hit { i + 1 } else { nodes[i].skip }`, until `i` is the number of nodes.

use glam::Vec3;

/// A box, and where to go from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// Smallest coordinates.
    pub low: Vec3,
    /// Largest coordinates.
    pub high: Vec3,
    /// The next node for who has missed this one, or has done with this leaf.
    pub skip: u32,
    /// The first of a leaf's items in [`Bvh::order`].
    pub first: u32,
    /// How many a leaf has; 0: no leaf, the next node is its child.
    pub count: u32,
}

/// The hierarchy.
#[derive(Clone, Debug, Default)]
pub struct Bvh {
    /// Depth first; the first is the root. None over no boxes.
    pub nodes: Vec<Node>,
    /// Items as leaves have them, one after the other.
    pub order: Vec<u32>,
}

/// Most items of a leaf.
pub const LEAF: usize = 4;

/// No node lies deeper: from half of it on items are halved and not cut.
pub const DEEPEST: usize = 64;

/// Places that are tried for a cut, along each axis.
const BINS: usize = 16;

/// A box: smallest and largest coordinates.
pub type Bounds = (Vec3, Vec3);

/// The box of nothing, which any other extends.
const NOTHING: Bounds = (Vec3::INFINITY, Vec3::NEG_INFINITY);

fn join(a: Bounds, b: Bounds) -> Bounds {
    (a.0.min(b.0), a.1.max(b.1))
}

/// Half the area of a box; 0 of nothing.
fn area((low, high): Bounds) -> f32 {
    let size = (high - low).max(Vec3::ZERO);
    size.x * size.y + size.y * size.z + size.z * size.x
}

impl Bvh {
    /// Over these boxes, which are finite.
    pub fn new(boxes: &[Bounds]) -> Self {
        let mut bvh = Self { nodes: Vec::new(), order: (0..boxes.len() as u32).collect() };
        let centres: Vec<Vec3> = boxes.iter().map(|(low, high)| low * 0.5 + high * 0.5).collect();
        // Left part after right part on the stack, so that it comes first. A part is a range of the order; of a node that waits for its end, `None`.
        let mut todo = vec![Some((0, boxes.len()))];
        let mut open = Vec::new();
        while let Some(next) = todo.pop() {
            let Some((begin, end)) = next else {
                let node: usize = open.pop().unwrap_or_default();
                bvh.nodes[node].skip = bvh.nodes.len() as u32;
                continue;
            };
            if begin == end {
                continue;
            }
            let items = &mut bvh.order[begin..end];
            let bounds = items.iter().fold(NOTHING, |all, &i| join(all, boxes[i as usize]));
            let here = bvh.nodes.len();
            let leaf = Node {
                low: bounds.0,
                high: bounds.1,
                skip: here as u32 + 1,
                first: begin as u32,
                count: (end - begin) as u32,
            };
            if end - begin <= LEAF {
                bvh.nodes.push(leaf);
                continue;
            }
            bvh.nodes.push(Node { first: 0, count: 0, ..leaf });
            open.push(here);
            // As many are open as it lies deep.
            let first = if open.len() > DEEPEST / 2 { items.len() / 2 } else { cut(items, boxes, &centres) };
            let middle = begin + first;
            todo.extend([None, Some((middle, end)), Some((begin, middle))]);
        }
        bvh
    }

    /// The same tree about other boxes of the same items: of each node the box of what is in it.
    pub fn refit(&self, boxes: &[Bounds]) -> Vec<Node> {
        let mut nodes = self.nodes.clone();
        // Children come after their parents; each gives its box to the one it is in.
        let mut parents = vec![0; nodes.len()];
        let mut inside: Vec<usize> = Vec::new();
        for (i, node) in nodes.iter().enumerate() {
            while inside.last().is_some_and(|&parent| nodes[parent].skip as usize <= i) {
                inside.pop();
            }
            parents[i] = inside.last().copied().unwrap_or(i);
            if node.count == 0 {
                inside.push(i);
            }
        }
        for node in &mut nodes {
            let items = &self.order[node.first as usize..(node.first + node.count) as usize];
            (node.low, node.high) = items.iter().fold(NOTHING, |all, &i| join(all, boxes[i as usize]));
        }
        for i in (1..nodes.len()).rev() {
            let (child, parent) = (nodes[i], &mut nodes[parents[i]]);
            (parent.low, parent.high) = join((parent.low, parent.high), (child.low, child.high));
        }
        nodes
    }
}

/// Divides items in two, each with some; how many are in the first.
fn cut(items: &mut [u32], boxes: &[Bounds], centres: &[Vec3]) -> usize {
    let (low, high) =
        items.iter().fold(NOTHING, |all, &i| join(all, (centres[i as usize], centres[i as usize])));
    let bin = |axis: usize, item: u32| {
        let share = (centres[item as usize][axis] - low[axis]) / (high[axis] - low[axis]);
        ((share * BINS as f32) as usize).min(BINS - 1)
    };
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in 0..3 {
        // Of centres in one place no cut is of use.
        if !((high[axis] - low[axis]).is_normal()) {
            continue;
        }
        let mut bins = [(NOTHING, 0usize); BINS];
        for &item in &*items {
            let bin = &mut bins[bin(axis, item)];
            *bin = (join(bin.0, boxes[item as usize]), bin.1 + 1);
        }
        let mut after = [(NOTHING, 0usize); BINS + 1];
        for i in (0..BINS).rev() {
            after[i] = (join(after[i + 1].0, bins[i].0), after[i + 1].1 + bins[i].1);
        }
        let mut before = (NOTHING, 0);
        for i in 1..BINS {
            before = (join(before.0, bins[i - 1].0), before.1 + bins[i - 1].1);
            let cost = area(before.0) * before.1 as f32 + area(after[i].0) * after[i].1 as f32;
            let divides = before.1 > 0 && after[i].1 > 0;
            if divides && best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, i));
            }
        }
    }
    let Some((_, axis, first)) = best else {
        return items.len() / 2;
    };
    let mut count = 0;
    for i in 0..items.len() {
        if bin(axis, items[i]) < first {
            items.swap(i, count);
            count += 1;
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scattered boxes, some of them in one place.
    fn boxes(count: u32) -> Vec<Bounds> {
        let part = |i: u32, k: u32| {
            (i.wrapping_mul(2_654_435_761u32.wrapping_mul(2 * k + 1)) >> 8) as f32 / 16_777_216.0
        };
        (0..count)
            .map(|i| {
                let i = if i % 5 == 0 { 0 } else { i % 4099 };
                let low = Vec3::new(part(i, 1), part(i, 2), part(i, 3));
                (low, low + 0.03 * Vec3::new(part(i, 4), part(i, 5), part(i, 6)))
            })
            .collect()
    }

    fn found(nodes: &[Node], order: &[u32], boxes: &[Bounds], point: Vec3) -> (Vec<u32>, usize) {
        let inside = |(low, high): Bounds| point.cmpge(low).all() && point.cmple(high).all();
        let (mut i, mut visited, mut items) = (0, 0, Vec::new());
        while let Some(node) = nodes.get(i) {
            visited += 1;
            if !inside((node.low, node.high)) {
                i = node.skip as usize;
                continue;
            }
            let leaf = &order[node.first as usize..(node.first + node.count) as usize];
            items.extend(leaf.iter().filter(|&&item| inside(boxes[item as usize])));
            i += 1;
        }
        items.sort_unstable();
        (items, visited)
    }

    /// Of the deepest node; the root's is 0.
    fn depth(nodes: &[Node]) -> usize {
        let (mut inside, mut deepest): (Vec<u32>, _) = (Vec::new(), 0);
        for (i, node) in nodes.iter().enumerate() {
            inside.retain(|end| *end > i as u32);
            deepest = deepest.max(inside.len());
            inside.push(node.skip);
        }
        deepest
    }

    #[test]
    fn no_tree_is_deep() {
        // Each twice as far away as the one before: a cut takes off the last few alone.
        let far: Vec<Bounds> =
            (0..4000).map(|i| Vec3::splat(1e-30 * 1.05f32.powi(i % 1400))).map(|low| (low, low)).collect();
        let bvh = Bvh::new(&far);
        let found = depth(&bvh.nodes);
        assert!(found > DEEPEST / 2 && found <= DEEPEST, "{found}");
    }

    #[test]
    fn every_box_is_found_and_few_nodes_are_looked_at() {
        for count in [0, 1, 4, 5, 3000] {
            let boxes = boxes(count);
            let bvh = Bvh::new(&boxes);
            let grown: Vec<Bounds> = boxes.iter().map(|(l, h)| (*l - 0.1, *h + 0.1)).collect();
            let refitted = bvh.refit(&grown);
            let mut order = bvh.order.clone();
            order.sort_unstable();
            assert_eq!(order, (0..count).collect::<Vec<_>>());
            assert!(bvh.nodes.iter().all(|node| node.count as usize <= LEAF));
            assert!(depth(&bvh.nodes) <= DEEPEST);
            for i in 0..20 {
                let point = Vec3::new(0.05 * i as f32, 0.3 + 0.02 * i as f32, 0.9 - 0.04 * i as f32);
                for (nodes, boxes) in [(&bvh.nodes, &boxes), (&refitted, &grown)] {
                    let inside = |b: &Bounds| point.cmpge(b.0).all() && point.cmple(b.1).all();
                    let all: Vec<u32> = (0..count).filter(|item| inside(&boxes[*item as usize])).collect();
                    let (items, visited) = found(nodes, &bvh.order, boxes, point);
                    assert_eq!(items, all);
                    assert!(
                        visited <= nodes.len() && (count < 1000 || visited < nodes.len() / 2),
                        "{visited}"
                    );
                }
            }
        }
    }
}
