//! Silhouettes as bits.

use skinsplat_core::scene::Mask;

/// Which pixels are covered by half or more.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Shadow {
    pub(super) width: usize,
    pub(super) height: usize,
    bits: Vec<u64>,
    /// Covered pixels.
    pub(super) area: u32,
}

impl Shadow {
    pub(super) fn of(mask: &Mask) -> Self {
        let mut bits = vec![0_u64; mask.values().len().div_ceil(64)];
        for (i, &value) in mask.values().iter().enumerate() {
            bits[i / 64] |= u64::from(value >= 0.5) << (i % 64);
        }
        let area = bits.iter().map(|word| word.count_ones()).sum();
        Self { width: mask.width(), height: mask.height(), bits, area }
    }

    pub(super) fn at(&self, x: usize, y: usize) -> bool {
        let i = y * self.width + x;
        self.bits[i / 64] >> (i % 64) & 1 == 1
    }

    fn common(&self, other: &Self) -> u32 {
        self.bits.iter().zip(&other.bits).map(|(a, b)| (a & b).count_ones()).sum()
    }

    /// Intersection over union; none if both are empty or of different sizes.
    pub(super) fn overlap(&self, other: &Self) -> Option<f64> {
        let common = self.common(other);
        ratio(common, self.area + other.area - common).filter(|_| self.same_size(other))
    }

    /// As [`Self::overlap`], with all that the other does not cover.
    pub(super) fn overlap_with_outside(&self, other: &Self) -> Option<f64> {
        let pixels = (self.width * self.height) as u32;
        let common = self.area - self.common(other);
        ratio(common, self.area + (pixels - other.area) - common).filter(|_| self.same_size(other))
    }

    fn same_size(&self, other: &Self) -> bool {
        (self.width, self.height) == (other.width, other.height)
    }

    /// First and last column and row that are covered, exclusive: left, right, top, bottom.
    pub(super) fn bounds(&self) -> Option<[f64; 4]> {
        let mut bounds: Option<[usize; 4]> = None;
        for y in 0..self.height {
            for x in (0..self.width).filter(|&x| self.at(x, y)) {
                let [left, right, top, _] = bounds.unwrap_or([x, x + 1, y, y + 1]);
                bounds = Some([left.min(x), right.max(x + 1), top, y + 1]);
            }
        }
        bounds.map(|bounds| bounds.map(|edge| edge as f64))
    }

    /// How much of the border of the image it covers.
    pub(super) fn share_of_border(&self) -> f64 {
        let (w, h) = (self.width, self.height);
        let rows = (0..w).flat_map(|x| [(x, 0), (x, h - 1)]);
        let columns = (0..h).flat_map(|y| [(0, y), (w - 1, y)]);
        let covered = rows.chain(columns).filter(|&(x, y)| self.at(x, y)).count();
        covered as f64 / (2 * (w + h)) as f64
    }

    /// True if the shadow reaches the border of the image.
    pub(super) fn is_cut(&self) -> bool {
        let (right, bottom) = (self.width as f64, self.height as f64);
        self.bounds().is_some_and(|[l, r, t, b]| l <= 0.0 || t <= 0.0 || r >= right || b >= bottom)
    }
}

fn ratio(a: u32, b: u32) -> Option<f64> {
    (b > 0).then(|| f64::from(a) / f64::from(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shadow(values: &[f32]) -> Shadow {
        Shadow::of(&Mask::new(4, values.len() / 4, values.to_vec()).unwrap())
    }

    #[test]
    fn overlaps_are_those_of_sets() {
        let a = shadow(&[1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0]);
        let b = shadow(&[0.0, 0.5, 0.7, 0.0, 0.0, 0.4, 0.0, 0.0]);
        assert_eq!((a.area, b.area), (4, 2));
        assert_eq!(a.overlap(&b), Some(1.0 / 5.0));
        assert_eq!(a.overlap_with_outside(&b), Some(3.0 / 7.0));
        assert_eq!(b.bounds(), Some([1.0, 3.0, 0.0, 1.0]));
        let none = shadow(&[0.0; 8]);
        assert_eq!((none.overlap(&none), none.bounds()), (None, None));
        assert!(a.is_cut() && a.at(1, 1) && !a.at(2, 0));
    }
}
