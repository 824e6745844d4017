//! Skinning weights in compressed rows: any number of influences per vertex or Gaussian.

use super::SceneError;

/// Joint indices and weights of each row (vertex or Gaussian). Rows sum to one within [`SkinWeights::SUM_TOLERANCE`].
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "Unchecked"))]
pub struct SkinWeights {
    offsets: Vec<u32>,
    joints: Vec<u16>,
    weights: Vec<f32>,
}

impl SkinWeights {
    /// How far a row's sum may be from one (16-bit normalised files are off by 3e-5). Values are kept as given.
    pub const SUM_TOLERANCE: f64 = 1e-3;

    /// How far a row's sum may be from one for [`SkinWeights::normalise`] to repair it: three influences of 8 bits, or
    /// weights cut to the largest four, stay within.
    pub const REPAIRABLE: f64 = 0.0301;

    /// Divides rows by their sum where that is off by more than [`SkinWeights::SUM_TOLERANCE`] and by no more than
    /// [`SkinWeights::REPAIRABLE`]. Says how many there were and how far off, if any.
    pub fn normalise(rows: &mut [Vec<(usize, f32)>]) -> Option<String> {
        let (mut count, mut least, mut most) = (0, f64::MAX, f64::MIN);
        for row in rows.iter_mut() {
            let sum: f64 = row.iter().map(|(_, w)| f64::from(*w)).sum();
            let off = (sum - 1.0).abs();
            if off > Self::SUM_TOLERANCE && off <= Self::REPAIRABLE {
                row.iter_mut().for_each(|(_, w)| *w = (f64::from(*w) / sum) as f32);
                (count, least, most) = (count + 1, sum.min(least), sum.max(most));
            }
        }
        (count > 0).then(|| {
            format!(
                "{count} of {} rows summed to {least:.4} to {most:.4} and were divided by their sum",
                rows.len()
            )
        })
    }

    /// Builds the table from rows of (joint, weight), dropping exact zeros.
    ///
    /// # Errors
    /// A joint index out of range, a negative or non-finite weight, an empty row or a row that does not sum to one; the
    /// field names the row.
    pub fn from_rows<R>(rows: impl IntoIterator<Item = R>, num_joints: usize) -> Result<Self, SceneError>
    where
        R: IntoIterator<Item = (usize, f32)>,
    {
        let mut table = Self { offsets: vec![0], joints: Vec::new(), weights: Vec::new() };
        for (i, row) in rows.into_iter().enumerate() {
            let start = table.weights.len();
            for (joint, weight) in row {
                check_weight(i, weight)?;
                if weight == 0.0 {
                    continue;
                }
                if joint >= num_joints || joint > usize::from(u16::MAX) {
                    let expected = format!("an index below {num_joints}");
                    return Err(SceneError::new(format!("joints[{i}]"), format!("joint {joint}"), expected));
                }
                table.joints.push(joint as u16);
                table.weights.push(weight);
            }
            check_row(i, &table.weights[start..])?;
            table.offsets.push(table.joints.len() as u32);
        }
        Ok(table)
    }

    /// Number of rows.
    #[inline]
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// True if there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The joints and weights of row `i`, in stored order.
    #[inline]
    pub fn row(&self, i: usize) -> (&[u16], &[f32]) {
        let range = self.offsets[i] as usize..self.offsets[i + 1] as usize;
        (&self.joints[range.clone()], &self.weights[range])
    }

    /// Checks that every joint index is below `num_joints`, the joints that deform the mesh
    /// ([`Skeleton::num_joints`](super::Skeleton::num_joints)).
    ///
    /// # Errors
    /// The first row with another; the error's field is `field[row]`.
    pub fn check_joints(&self, field: &str, num_joints: usize) -> Result<(), SceneError> {
        let Some(at) = self.joints.iter().position(|&joint| usize::from(joint) >= num_joints) else {
            return Ok(());
        };
        let row = self.offsets.partition_point(|&offset| offset as usize <= at) - 1;
        let expected = format!("an index below the body's {num_joints} joints");
        Err(SceneError::new(format!("{field}[{row}]"), format!("joint {}", self.joints[at]), expected))
    }

    /// The largest number of influences in any row.
    pub fn max_influences(&self) -> usize {
        self.offsets.windows(2).map(|w| (w[1] - w[0]) as usize).max().unwrap_or(0)
    }

    /// The convex combination `Σ coefficient * row` as sorted (joint, weight) pairs, accumulated in f64.
    pub fn mixed(&self, rows: &[(usize, f64)]) -> Vec<(usize, f32)> {
        let mut sum = std::collections::BTreeMap::new();
        for &(row, coefficient) in rows {
            let (joints, weights) = self.row(row);
            for (&joint, &weight) in joints.iter().zip(weights) {
                *sum.entry(usize::from(joint)).or_insert(0.0f64) += coefficient * f64::from(weight);
            }
        }
        sum.into_iter().map(|(joint, weight)| (joint, weight as f32)).collect()
    }
}

/// That the weights of row `i` are usable and sum to one.
fn check_row(i: usize, weights: &[f32]) -> Result<(), SceneError> {
    weights.iter().try_for_each(|&weight| check_weight(i, weight))?;
    // An empty `sum` is -0.
    let sum = weights.iter().fold(0.0, |sum, &weight| sum + f64::from(weight));
    if (sum - 1.0).abs() > SkinWeights::SUM_TOLERANCE {
        return Err(SceneError::new(format!("weights[{i}]"), format!("sum {sum}"), "a sum of 1"));
    }
    Ok(())
}

fn check_weight(i: usize, weight: f32) -> Result<(), SceneError> {
    if weight.is_finite() && weight >= 0.0 {
        return Ok(());
    }
    Err(SceneError::new(format!("weights[{i}]"), format!("weight {weight}"), "a finite number, at least 0"))
}

/// The table as it is stored: nothing holds of it yet.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
#[serde(rename = "SkinWeights")]
struct Unchecked {
    offsets: Vec<u32>,
    joints: Vec<u16>,
    weights: Vec<f32>,
}

#[cfg(feature = "serde")]
impl TryFrom<Unchecked> for SkinWeights {
    type Error = SceneError;

    /// Joint indices are those of a body, which is not known here: [`Avatar::validate`](super::Avatar::validate) checks
    /// them.
    fn try_from(stored: Unchecked) -> Result<Self, SceneError> {
        let Unchecked { offsets, joints, weights } = stored;
        if joints.len() != weights.len() {
            let problem = format!("{} values", joints.len());
            return Err(SceneError::new("joints", problem, format!("{}, one per weight", weights.len())));
        }
        let ends = offsets.first().zip(offsets.last());
        let whole = ends.is_some_and(|(&first, &last)| first == 0 && last as usize == weights.len());
        if !whole || !offsets.is_sorted() {
            let expected = format!("ascending, from 0 to {}", weights.len());
            return Err(SceneError::new("offsets", "they are not those of the weights", expected));
        }
        for (i, row) in offsets.windows(2).enumerate() {
            check_row(i, &weights[row[0] as usize..row[1] as usize])?;
        }
        Ok(Self { offsets, joints, weights })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_keep_their_order_and_lose_zeros() {
        let weights =
            SkinWeights::from_rows([vec![(2, 0.75), (0, 0.0), (1, 0.25)], vec![(0, 1.0)]], 3).unwrap();
        assert_eq!(weights.row(0), (&[2u16, 1][..], &[0.75f32, 0.25][..]));
        assert_eq!((weights.len(), weights.max_influences()), (2, 2));
        assert_eq!(weights.mixed(&[(0, 0.5), (1, 0.5)]), vec![(0, 0.5), (1, 0.125), (2, 0.375)]);
    }

    #[test]
    fn the_row_of_a_joint_that_the_body_lacks_is_named() {
        let rows = [vec![(0, 1.0)], vec![(0, 0.5), (1, 0.5)], vec![(2, 0.75), (0, 0.25)], vec![(1, 1.0)]];
        let weights = SkinWeights::from_rows(rows, 3).unwrap();
        weights.check_joints("joint", 3).unwrap();
        let error = weights.check_joints("joint", 2).unwrap_err().to_string();
        assert_eq!(error, "joint[2]: joint 2; expected an index below the body's 2 joints");
        assert_eq!(weights.check_joints("weights", 0).unwrap_err().field, "weights[0]");
    }

    #[test]
    fn bad_rows_are_named() {
        for (row, field) in [
            (vec![(0, 0.5)], "weights[1]"),
            (vec![], "weights[1]"),
            (vec![(0, f32::NAN)], "weights[1]"),
            (vec![(0, -1.0), (1, 2.0)], "weights[1]"),
            (vec![(3, 1.0)], "joints[1]"),
        ] {
            let error = SkinWeights::from_rows([vec![(0, 1.0)], row], 3).unwrap_err();
            assert_eq!(error.field, field, "{error}");
        }
    }

    #[cfg(feature = "serde")]
    #[test]
    fn stored_tables_are_checked() {
        let weights = SkinWeights::from_rows([vec![(2, 0.75), (1, 0.25)], vec![(0, 1.0)]], 3).unwrap();
        let stored = serde_json::to_string(&weights).unwrap();
        assert_eq!(stored, r#"{"offsets":[0,2,3],"joints":[2,1,0],"weights":[0.75,0.25,1.0]}"#);
        assert_eq!(serde_json::from_str::<SkinWeights>(&stored).unwrap(), weights);
        for (found, broken, field) in [
            ("[0,2,3]", "[]", "offsets"),
            ("[0,2,3]", "[0,2,4]", "offsets"),
            ("[0,2,3]", "[0,3,2,3]", "offsets"),
            ("[0,2,3]", "[1,2,3]", "offsets"),
            ("[0,2,3]", "[0,3,3]", "weights[0]"),
            ("[2,1,0]", "[2,1]", "joints"),
            ("0.75", "-0.75", "weights[0]"),
            ("1.0", "0.5", "weights[1]"),
        ] {
            let error = serde_json::from_str::<SkinWeights>(&stored.replace(found, broken)).unwrap_err();
            assert!(error.to_string().starts_with(field), "{broken}: {error}");
        }
    }
}
