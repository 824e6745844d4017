//! What a frame header says of components and their blocks.

/// A larger image is not walked.
const MAX_PIXELS: u64 = 1 << 26;

/// What a frame header says, with what the scans so far have said.
pub(super) struct Frame {
    pub(super) progressive: bool,
    pub(super) components: Vec<Component>,
    /// Of an interleaved scan.
    pub(super) mcus: usize,
}

pub(super) struct Component {
    pub(super) id: u8,
    /// Blocks per MCU of an interleaved scan.
    pub(super) per_mcu: usize,
    /// Blocks of a scan of this component alone: those with a pixel of the image.
    pub(super) blocks: usize,
    /// One bit per coefficient that is not zero so far, by block; empty before the first AC scan.
    pub(super) nonzero: Vec<u64>,
    /// The lowest bit that the scans so far have, by coefficient.
    pub(super) lowest: [Option<u8>; 64],
}

impl Frame {
    /// `None` for what is not walked.
    pub(super) fn read(content: &[u8], progressive: bool) -> Option<Self> {
        let &[8, h1, h0, w1, w0, count, ref rest @ ..] = content else { return None };
        let size = [u16::from_be_bytes([w1, w0]), u16::from_be_bytes([h1, h0])].map(usize::from);
        let pixels = size[0] as u64 * size[1] as u64;
        if pixels == 0
            || pixels > MAX_PIXELS
            || !(1..=4).contains(&count)
            || rest.len() != 3 * usize::from(count)
        {
            return None;
        }
        let factors = |sampling: u8| [usize::from(sampling >> 4), usize::from(sampling & 15)];
        let mut most = [1; 2];
        for component in rest.chunks_exact(3) {
            for (axis, factor) in factors(component[1]).into_iter().enumerate() {
                if !(1..=4).contains(&factor) {
                    return None;
                }
                most[axis] = most[axis].max(factor);
            }
        }
        let component = |bytes: &[u8]| {
            let factors = factors(bytes[1]);
            let blocks = |axis: usize| (size[axis] * factors[axis]).div_ceil(8 * most[axis]);
            Component {
                id: bytes[0],
                per_mcu: factors[0] * factors[1],
                blocks: blocks(0) * blocks(1),
                nonzero: Vec::new(),
                lowest: [None; 64],
            }
        };
        let components: Vec<_> = rest.chunks_exact(3).map(component).collect();
        let alike = |i: usize| components[..i].iter().any(|before| before.id == components[i].id);
        if (1..components.len()).any(alike) {
            return None;
        }
        let mcus = size[0].div_ceil(8 * most[0]) * size[1].div_ceil(8 * most[1]);
        Some(Self { progressive, components, mcus })
    }
}
