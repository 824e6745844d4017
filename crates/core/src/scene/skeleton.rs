//! Hierarchies of joints.

use super::{HandSpaces, SceneError};
use glam::{DAffine3, DQuat, DVec3};
use std::sync::Arc;

/// Translation, rotation and scale of a node relative to its parent, applied in the order scale, rotation, translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalTransform {
    /// Metres.
    pub translation: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
    /// Factor per axis.
    pub scale: DVec3,
}

impl LocalTransform {
    /// No motion.
    pub const IDENTITY: Self =
        Self { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE };

    /// As an affine map.
    pub fn to_affine(self) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

/// A hierarchy of nodes. The first [`Skeleton::num_joints`] nodes deform the mesh; further ones only carry them (glTF
/// ancestors of the joints).
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    /// A name per node ("joint 7" where the file has none).
    pub names: Vec<String>,
    /// Parent node; `None` for roots.
    pub parents: Vec<Option<usize>>,
    /// Transform of each node relative to its parent, in the rest pose.
    pub rest_locals: Vec<LocalTransform>,
    /// Joint-from-mesh transform in the bind pose, one per deforming joint.
    pub inverse_binds: Vec<DAffine3>,
    /// How hand poses are read, of models that say so.
    pub hands: Option<Arc<HandSpaces>>,
    /// Parents before children.
    pub(super) order: Vec<usize>,
}

impl Skeleton {
    /// Builds a skeleton and finds an order in which parents come before children.
    ///
    /// # Errors
    /// A parent index out of range, a cycle, arrays of different lengths, values that are not finite.
    pub fn new(
        names: Vec<String>,
        parents: Vec<Option<usize>>,
        rest_locals: Vec<LocalTransform>,
        inverse_binds: Vec<DAffine3>,
    ) -> Result<Self, SceneError> {
        let n = parents.len();
        if names.len() != n || rest_locals.len() != n || inverse_binds.len() > n || inverse_binds.is_empty() {
            return Err(SceneError::new(
                "joints",
                "arrays of different lengths",
                "one entry per joint, at least one",
            ));
        }
        if let Some((i, &Some(parent))) = parents.iter().enumerate().find(|(_, p)| p.is_some_and(|p| p >= n))
        {
            return Err(SceneError::new(format!("parents[{i}]"), format!("{parent}"), format!("below {n}")));
        }
        for (i, local) in rest_locals.iter().enumerate() {
            if !(local.translation.is_finite() && local.rotation.is_finite() && local.scale.is_finite()) {
                return Err(SceneError::new(
                    format!("rest transform[{i}]"),
                    "NaN or infinite",
                    "finite values",
                ));
            }
        }
        if let Some(i) = inverse_binds.iter().position(|m| !m.is_finite()) {
            return Err(SceneError::new(format!("inverse bind[{i}]"), "NaN or infinite", "finite values"));
        }
        let order = topological_order(&parents)?;
        Ok(Self { names, parents, rest_locals, inverse_binds, hands: None, order })
    }

    /// A skeleton of pure translations (SMPL): joint positions in the rest pose.
    ///
    /// # Errors
    /// As [`Skeleton::new`].
    pub fn from_joint_positions(
        names: Vec<String>,
        parents: Vec<Option<usize>>,
        positions: &[DVec3],
    ) -> Result<Self, SceneError> {
        if positions.len() != parents.len() {
            return Err(SceneError::new(
                "joints",
                format!("{} positions", positions.len()),
                "one per parent",
            ));
        }
        let local = |(&position, parent): (&DVec3, &Option<usize>)| LocalTransform {
            translation: position
                - parent.map_or(DVec3::ZERO, |p| positions.get(p).copied().unwrap_or(DVec3::ZERO)),
            ..LocalTransform::IDENTITY
        };
        let rest_locals = positions.iter().zip(&parents).map(local).collect();
        let inverse_binds = positions.iter().map(|&p| DAffine3::from_translation(-p)).collect();
        Self::new(names, parents, rest_locals, inverse_binds)
    }

    /// Number of nodes.
    #[inline]
    pub fn len(&self) -> usize {
        self.parents.len()
    }

    /// True if there are no nodes (never, after [`Skeleton::new`]).
    pub fn is_empty(&self) -> bool {
        self.parents.is_empty()
    }

    /// Number of nodes that deform the mesh.
    #[inline]
    pub fn num_joints(&self) -> usize {
        self.inverse_binds.len()
    }

    /// World transform of every node, given those relative to the parents ([`Pose::locals`](super::Pose::locals)).
    pub fn world_transforms(&self, locals: &[LocalTransform]) -> Vec<DAffine3> {
        let mut world = vec![DAffine3::IDENTITY; self.len()];
        for &node in &self.order {
            let local = locals[node].to_affine();
            world[node] = match self.parents[node] {
                Some(parent) => world[parent] * local,
                None => local,
            };
        }
        world
    }

    /// Rotation of every node relative to the rest pose, scales left out.
    pub(super) fn rotations_from_rest(&self, locals: &[LocalTransform]) -> Vec<DQuat> {
        let chained = |locals: &[LocalTransform]| {
            let mut world = vec![DQuat::IDENTITY; self.len()];
            for &node in &self.order {
                let local = locals[node].rotation;
                world[node] = self.parents[node].map_or(local, |parent| world[parent] * local);
            }
            world
        };
        let (posed, rest) = (chained(locals), chained(&self.rest_locals));
        posed.iter().zip(rest).map(|(posed, rest)| (*posed * rest.inverse()).normalize()).collect()
    }
}

fn topological_order(parents: &[Option<usize>]) -> Result<Vec<usize>, SceneError> {
    let mut children = vec![Vec::new(); parents.len()];
    let mut stack: Vec<usize> = Vec::new();
    for (i, parent) in parents.iter().enumerate() {
        match parent {
            Some(p) => children[*p].push(i),
            None => stack.push(i),
        }
    }
    stack.reverse();
    let mut order = Vec::with_capacity(parents.len());
    while let Some(node) = stack.pop() {
        order.push(node);
        stack.extend(children[node].iter().rev());
    }
    if order.len() < parents.len() {
        let mut reached = vec![false; parents.len()];
        order.iter().for_each(|&node| reached[node] = true);
        let stuck = reached.iter().position(|reached| !reached).unwrap_or_default();
        return Err(SceneError::new(format!("parents[{stuck}]"), "a cycle", "a tree of joints"));
    }
    Ok(order)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycles_and_foreign_parents_are_refused() {
        let names = || vec![String::new(), String::new()];
        let cycle = Skeleton::from_joint_positions(names(), vec![Some(1), Some(0)], &[DVec3::ZERO; 2]);
        assert_eq!(cycle.unwrap_err().problem, "a cycle");
        let foreign = Skeleton::from_joint_positions(names(), vec![None, Some(7)], &[DVec3::ZERO; 2]);
        assert_eq!(foreign.unwrap_err().field, "parents[1]");
    }
}
