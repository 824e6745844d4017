//! How a surface passes through a cube: which of its edges are crossed by the same sheet.
//!
//! Corner c of a cell is at (c & 1, c >> 1 & 1, c >> 2). Edge `4 a + p + 2 q` runs along axis a, at p along axis a + 1 and
//! q along axis a + 2 (cyclically).

use glam::DVec3;

/// The edge along `axis` at the given places (0 or 1) along the next two axes.
pub(super) fn edge(axis: usize, p: usize, q: usize) -> usize {
    4 * axis + p + 2 * q
}

/// Lower and upper corner of an edge.
fn ends(edge: usize) -> [usize; 2] {
    let axis = edge / 4;
    let lower = (edge & 1) << ((axis + 1) % 3) | (edge >> 1 & 1) << ((axis + 2) % 3);
    [lower, lower | 1 << axis]
}

/// For each of the 256 sets of inside corners, the sheets of the surface: a bit per crossed edge.
///
/// On each face of the cube the crossings are joined in pairs; where two opposite corners are inside, each is cut off on its
/// own. The rule depends on the face alone, so that both cells at it agree: a vertex per sheet makes a surface without
/// pinched points, also where two fingers nearly touch.
pub(super) fn sheets_of_all_cases() -> Vec<Vec<u16>> {
    (0..=u8::MAX).map(sheets).collect()
}

fn sheets(inside: u8) -> Vec<u16> {
    let is_inside = |corner: usize| inside >> corner & 1 == 1;
    let crossed = |&e: &usize| is_inside(ends(e)[0]) != is_inside(ends(e)[1]);
    let mut sheets: Vec<u16> = (0..12).filter(crossed).map(|e| 1 << e).collect();
    for (axis, side) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]) {
        let on_face = |e: &usize| ends(*e).iter().all(|corner| corner >> axis & 1 == side);
        let crossings: Vec<usize> = (0..12).filter(on_face).filter(crossed).collect();
        let inside_end = |e: usize| ends(e).into_iter().find(|&c| is_inside(c));
        for (i, &a) in crossings.iter().enumerate() {
            for &b in &crossings[i + 1..] {
                if crossings.len() == 2 || inside_end(a) == inside_end(b) {
                    let (joined, mut others): (Vec<u16>, Vec<u16>) =
                        sheets.iter().partition(|&&sheet| sheet & (1 << a | 1 << b) != 0);
                    others.push(joined.into_iter().fold(0, |all, sheet| all | sheet));
                    sheets = others;
                }
            }
        }
    }
    sheets
}

/// Mean of the zero crossings on a sheet's edges, relative to the cell's lower corner, from the values at the corners.
pub(super) fn mean_crossing(values: &[f64; 8], sheet: u16) -> DVec3 {
    let at = |c: usize| DVec3::new((c & 1) as f64, (c >> 1 & 1) as f64, (c >> 2) as f64);
    let crossing = |e: usize| {
        let [a, b] = ends(e);
        at(a).lerp(at(b), values[a] / (values[a] - values[b]))
    };
    let sum: DVec3 = (0..12).filter(|e| sheet >> e & 1 == 1).map(crossing).sum();
    sum / f64::from(sheet.count_ones())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sheets_share_no_edge_and_cover_every_crossing() {
        for (inside, sheets) in sheets_of_all_cases().iter().enumerate() {
            let crossed = (0..12).filter(|&e| ends(e).map(|c| inside >> c & 1).iter().sum::<usize>() == 1);
            let all = crossed.fold(0u16, |mask, e| mask | 1 << e);
            assert_eq!(sheets.iter().fold(0, |mask, s| mask | s), all);
            assert_eq!(sheets.iter().map(|s| s.count_ones()).sum::<u32>(), all.count_ones());
            assert!(sheets.iter().all(|s| s.count_ones() >= 3), "a closed loop around the cell");
        }
    }

    #[test]
    fn opposite_corners_are_cut_off_apart() {
        assert_eq!(sheets(0b0000_0001).len(), 1);
        assert_eq!(sheets(0b1000_0001).len(), 2);
        // Inside but for two opposite corners: two sheets, though the inside hangs together.
        assert_eq!(sheets(0b0111_1110).len(), 2);
    }
}
