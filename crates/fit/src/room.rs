//! How much room there is below a surface before the next layer of it: lips are thin in front of the mouth's inside.

use super::disc::Disc;
use glam::{DVec3, IVec3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// For every disc, the depth below it of the nearest other disc in a cone around its inward normal (at most `cone` times as far
/// aside as below), metres; `reach` if there is none within that.
pub(super) fn room_below(discs: &[Disc], reach: f64, cone: f64) -> Vec<f64> {
    if reach <= 0.0 {
        return vec![0.0; discs.len()];
    }
    let cell = |point: DVec3| (point / reach).floor().as_ivec3();
    let mut cells: BTreeMap<[i32; 3], Vec<u32>> = BTreeMap::new();
    for (i, disc) in discs.iter().enumerate() {
        cells.entry(cell(disc.centre).to_array()).or_default().push(i as u32);
    }
    let room = |disc: &Disc| {
        let home = cell(disc.centre);
        let around = (0..27).map(|k| home.saturating_add(IVec3::new(k % 3, k / 3 % 3, k / 9) - 1));
        let near = around.filter_map(|c| cells.get(&c.to_array())).flatten();
        let depth = |&i: &u32| {
            let offset = discs[i as usize].centre - disc.centre;
            let depth = -offset.dot(disc.normal);
            let aside = (offset + disc.normal * depth).length();
            (depth > 0.0 && aside <= cone * depth).then_some(depth)
        };
        near.filter_map(depth).fold(reach, f64::min)
    };
    discs.par_iter().map(room).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;

    #[test]
    fn a_layer_below_limits_the_room_and_one_above_or_aside_does_not() {
        let disc = |centre: DVec3, normal: DVec3| Disc { centre, normal, area: 0.0, moment: DMat3::ZERO };
        let discs = [
            disc(DVec3::ZERO, DVec3::Z),
            disc(DVec3::new(0.001, 0.0, -0.004), -DVec3::Z),
            disc(DVec3::new(0.0, 0.0, 0.002), DVec3::Z),
            disc(DVec3::new(0.009, 0.0, -0.001), DVec3::Z),
            disc(DVec3::new(5.0, 0.0, 0.0), DVec3::X),
        ];
        let room = room_below(&discs, 0.02, 0.7);
        assert_eq!((room[0], room[2], room[4]), (0.004, 0.002, 0.02));
        assert_eq!(room_below(&discs, 0.0, 0.7), vec![0.0; 5]);
    }
}
