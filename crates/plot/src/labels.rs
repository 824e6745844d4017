//! Labels beside points, as many as fit without touching each other.

/// A box on the paper, pixels: left, top, right, bottom.
type Box = [i32; 4];

/// Room that a character takes at [`FONT_SIZE`], generously.
const CHARACTER: f64 = 7.0;
pub(super) const FONT_SIZE: i32 = 12;

/// Boxes that are taken.
pub(super) struct Taken {
    frame: Box,
    boxes: Vec<Box>,
}

impl Taken {
    /// Nothing is taken yet but a mark on every point.
    pub(super) fn new(frame: Box, points: impl Iterator<Item = (i32, i32)>) -> Self {
        Self { frame, boxes: points.map(|(x, y)| [x - 3, y - 3, x + 3, y + 3]).collect() }
    }

    /// Where the text goes (its top left corner), beside the point if there is room: right, left, above, below.
    pub(super) fn place(&mut self, (x, y): (i32, i32), text: &str) -> Option<(i32, i32)> {
        let width = (text.chars().count() as f64 * CHARACTER).ceil() as i32;
        let corners = [
            (x + 7, y - FONT_SIZE / 2),
            (x - 7 - width, y - FONT_SIZE / 2),
            (x - width / 2, y - 8 - FONT_SIZE),
            (x - width / 2, y + 7),
            (x + 5, y - 5 - FONT_SIZE),
            (x + 5, y + 5),
        ];
        let fits = |&(left, top): &(i32, i32)| {
            let wanted = [left, top, left + width, top + FONT_SIZE];
            inside(wanted, self.frame) && !self.boxes.iter().any(|&other| overlap(wanted, other))
        };
        let (left, top) = corners.into_iter().find(fits)?;
        self.boxes.push([left, top, left + width, top + FONT_SIZE]);
        Some((left, top))
    }
}

fn inside(a: Box, frame: Box) -> bool {
    a[0] >= frame[0] && a[1] >= frame[1] && a[2] <= frame[2] && a[3] <= frame[3]
}

fn overlap(a: Box, b: Box) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_never_touch_and_stay_on_the_paper() {
        let points: Vec<(i32, i32)> = (0..40).map(|i| (100 + (i * 37) % 90, 100 + (i * 53) % 70)).collect();
        let mut taken = Taken::new([0, 0, 300, 300], points.iter().copied());
        let placed = points.iter().filter(|&&p| taken.place(p, "label").is_some()).count();
        assert!((5..40).contains(&placed), "{placed}");
        let labels = &taken.boxes[points.len()..];
        for (i, &a) in labels.iter().enumerate() {
            assert!(inside(a, taken.frame) && !labels[..i].iter().any(|&b| overlap(a, b)));
        }
    }
}
