//! What came of the robots that a scene has.

use super::RobotReport;

/// What came of the robots that a scene has, in the order in which they were added. It isn't written to scene files, and says nothing of the scene: any two are equal.
#[derive(Clone, Debug, Default)]
pub struct Imports(Vec<RobotReport>);

impl PartialEq for Imports {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Imports {
    pub(super) fn add(&mut self, report: RobotReport) {
        self.0.push(report);
    }

    /// The reports, a robot each.
    pub fn reports(&self) -> &[RobotReport] {
        &self.0
    }

    /// What a run should tell of them: bodies that the water doesn't see, or not the whole of.
    pub(crate) fn warnings(&self) -> impl Iterator<Item = String> {
        self.0.iter().flat_map(|report| {
            let each = report.warnings.iter();
            each.map(|what| format!("robot {:?}: {what}", report.robot))
        })
    }
}
