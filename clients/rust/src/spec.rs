//! From an oracle and options to the protocol's MeshSpec. Ranges are the server's to check.

use crate::oracle::Checked;
use crate::proto::{Audit, BoundingBox, Criteria, MeshLimits, MeshSpec};
use crate::wire::to_wire;

/// All that is asked of a mesh beside its oracle and epsilon; mesh.proto says what each means.
#[derive(Clone, Debug, Default)]
pub struct MeshOptions {
    /// The refinement rules; with `size_rate` or `max_deviation` the mesh is graded.
    pub criteria: Criteria,
    /// Budgets and times.
    pub limits: MeshLimits,
    /// A promise: M's reach is at least this.
    pub reach: Option<f64>,
    /// Seeds are laid so densely that no component is missed, if the promise is true.
    pub cover_box: bool,
    /// How many components M has at least.
    pub components: u32,
    /// How many random points of the box are tried as seeds; 0: the default.
    pub box_seeds: u32,
    /// Seed of everything random; 0: the default.
    pub random_seed: u64,
    /// Free text for people.
    pub label: String,
    /// The certificate asks the oracle about the whole mesh, not about samples.
    pub thorough_audit: bool,
}

impl MeshOptions {
    pub(crate) fn spec(&self, checked: &Checked, epsilon: f64, far: bool) -> MeshSpec {
        let d = checked.d;
        let mut criteria = self.criteria;
        if far && criteria.speculative.is_none() {
            criteria.speculative = Some(true); // round trips are what a far server costs
        }
        MeshSpec {
            dimension: checked.k as u32,
            ambient_dimension: d as u32,
            epsilon,
            oracle: Some(checked.capabilities()),
            bounding_box: checked.oracle.bounding_box().map(|(lower, upper)| BoundingBox {
                lower: Some(to_wire(&lower, &[lower.len()])),
                upper: Some(to_wire(&upper, &[upper.len()])),
            }),
            seeds: checked.oracle.seeds().map(|seeds| to_wire(&seeds, &[seeds.len() / d, d])),
            criteria: Some(criteria),
            limits: Some(self.limits),
            random_seed: self.random_seed,
            label: self.label.clone(),
            box_seeds: self.box_seeds,
            declared_reach: self.reach,
            cover_box: self.cover_box,
            components: self.components,
            walls: checked.walls as u32,
            audit: if self.thorough_audit { Audit::Thorough } else { Audit::Unspecified }.into(),
            ..Default::default()
        }
    }
}
