//! A street of a suburb, and in it what methods fail at. Layers: house behind cladding behind shutters, millimetres apart, where occlusion that adds up is
//! too dark. Slopes: steep roofs and a bank seen at a grazing angle. Depth: poles and wires close before what is far. Off screen: a wall
//! beside the picture, which darkens what it shows and is not in it.

use glam::Vec3;

use super::parts::{Builder, here, plain, there};
use crate::surface::{Instance, Surface};
use std::sync::Arc;

pub(super) fn make(detail: u32) -> Vec<Instance> {
    let n = detail;
    let v = Vec3::new;
    let mut street = Builder::new("suburb street");
    street.of(plain("street", [0.4, 0.4, 0.42])).block(v(-600.0, -700.0, -20.0), v(600.0, 600.0, 0.0), 6 * n);
    // Kerbs, a millimetre above one another.
    street.of(plain("pavement", [0.6, 0.59, 0.56]));
    for side in [-1.0, 1.0] {
        for layer in 0..4 {
            let (inner, top) = (70.0 + 6.0 * layer as f32, 2.0 + 1.5 * layer as f32);
            let (low, high) = (f32::min(side * inner, side * 140.0), f32::max(side * inner, side * 140.0));
            street.block(v(low, -640.0, -1.0), v(high, 560.0, top), 3 * n);
        }
    }
    // Banks of 60° along both gardens' ends.
    street.of(plain("bank", [0.3, 0.4, 0.2]));
    let bank = [v(-600.0, 500.0, -1.0), v(-600.0, 600.0, -1.0), v(-600.0, 600.0, 172.0)];
    street.prism(&bank, Vec3::X * 1200.0, 4 * n);
    // What is not in the picture: a tall wall just outside its left border, on the first plot.
    street.of(plain("off screen", [0.5, 0.45, 0.4]));
    let beside = |far: f32, back: f32| v(-40.0 - 0.9 * far - back, far - 560.0, -1.0);
    street.prism(
        &[beside(160.0, 0.0), beside(330.0, 0.0), beside(330.0, 20.0), beside(160.0, 20.0)],
        Vec3::Z * 200.0,
        2 * n,
    );

    let mut pole = Builder::new("suburb pole");
    pole.of(plain("pole", [0.3, 0.28, 0.26]));
    pole.cylinder(v(0.0, 0.0, -1.0), v(0.0, 0.0, 210.0), [3.0, 2.2], 5 + n, 2 * n);
    pole.block(v(-22.0, -2.0, 195.0), v(22.0, 2.0, 199.0), n);
    let pole = pole.done();

    let home = home(n);
    let mut all = vec![here(street.done())];
    for i in 0..4 {
        let y = -330.0 + 225.0 * i as f32;
        // Gaps of a few mm between neighbours: 225 apart, 217 wide.
        if i > 0 {
            all.push(there(&home, v(-260.0, y, 0.0), 90.0, 1.0));
        }
        all.push(there(&home, v(260.0, y, 0.0), -90.0, 1.0));
        all.push(there(&pole, v(62.0, y + 80.0, 0.0), 10.0 * i as f32, 1.0));
    }
    all
}

/// A house that faces −y, 217 mm wide.
fn home(n: u32) -> Arc<Surface> {
    let v = Vec3::new;
    let mut home = Builder::new("suburb home");
    home.of(plain("wall", [0.74, 0.68, 0.58])).block(v(-108.0, -80.0, -1.0), v(108.0, 90.0, 130.0), 2 * n);
    // Boards over the wall, shutters over the boards, a trellis over the shutters: 3 mm each.
    home.of(plain("boards", [0.66, 0.7, 0.72]));
    for board in 0..9 {
        let z = 4.0 + 14.0 * board as f32;
        home.block(v(-106.0, -83.0, z), v(106.0, -81.5, z + 12.5), n);
    }
    home.of(plain("shutters", [0.2, 0.32, 0.26]));
    for x in [-62.0, 62.0] {
        for (from, to) in [(-34.0, -18.0), (18.0, 34.0)] {
            home.block(v(x + from, -86.0, 50.0), v(x + to, -84.5, 104.0), n);
            home.block(v(x + from + 2.0, -89.0, 54.0), v(x + to - 2.0, -87.5, 100.0), n);
        }
        for bar in 0..5 {
            home.block(
                v(x - 17.0 + 8.0 * bar as f32, -87.0, 50.0),
                v(x - 15.0 + 8.0 * bar as f32, -85.0, 104.0),
                n,
            );
        }
    }
    // Steps before the door, flat ones.
    for step in 0..4 {
        home.block(
            v(-16.0, -84.0 - 7.0 * (4 - step) as f32, -1.0),
            v(16.0, -81.0, 3.0 * (step + 1) as f32),
            n,
        );
    }
    // A hedge, close to the fence before it.
    home.of(plain("fence", [0.8, 0.8, 0.78]));
    for slat in 0..14 {
        let x = -106.0 + 15.3 * slat as f32;
        home.block(v(x, -118.0, -1.0), v(x + 11.0, -116.5, 34.0), n);
    }
    home.block(v(-107.0, -116.6, 20.0), v(107.0, -115.0, 24.0), n);
    home.of(plain("hedge", [0.2, 0.34, 0.14])).block(v(-105.0, -112.0, -1.0), v(105.0, -100.0, 30.0), 2 * n);
    // A roof of 60°, with eaves.
    home.of(plain("roof", [0.42, 0.2, 0.17]));
    let gable = [v(-108.0, -96.0, 129.0), v(-108.0, 104.0, 129.0), v(-108.0, 4.0, 302.0)];
    home.prism(&gable, Vec3::X * 216.0, 3 * n);
    home.of(plain("chimney", [0.5, 0.3, 0.24])).block(v(30.0, 20.0, 180.0), v(54.0, 44.0, 320.0), n);
    home.done()
}
