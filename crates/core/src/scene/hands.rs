//! The pose spaces of hands, as SMPL-H and SMPL-X have them.

/// One hand: its mean pose and the principal components around it.
#[derive(Clone, Debug, PartialEq)]
pub struct HandSpace {
    /// Axis-angle vectors one after the other, radians; what SMPL-X adds to every hand pose unless its mean is flat.
    pub mean: Vec<f64>,
    /// Principal components, each as long as the mean; empty if the model has none.
    pub components: Vec<Vec<f64>>,
}

/// Both hands.
#[derive(Clone, Debug, PartialEq)]
pub struct HandSpaces {
    /// `hands_meanl`, `hands_componentsl`.
    pub left: HandSpace,
    /// `hands_meanr`, `hands_componentsr`.
    pub right: HandSpace,
}

impl HandSpace {
    /// Axis-angle values of principal coefficients, the mean left out; `None` if the hand has fewer components.
    pub fn pose_of(&self, coefficients: &[f64]) -> Option<Vec<f64>> {
        let components = self.components.get(..coefficients.len())?;
        let mut pose = vec![0.0; self.mean.len()];
        for (component, &coefficient) in components.iter().zip(coefficients) {
            pose.iter_mut().zip(component).for_each(|(sum, &value)| *sum += coefficient * value);
        }
        Some(pose)
    }

    /// True if the mean is the flat hand.
    pub fn is_flat(&self) -> bool {
        self.mean.iter().all(|&v| v == 0.0)
    }
}
