//! Which rigid motions of bodies that feel one another are free, and along which of them momentum is kept.

use crate::adjoint::lie::{Mat6, Vec3};
use crate::dynamics::force::{Outside, Together};
use crate::dynamics::{
    ContactModel, FreeMotions, Group, Motions, Parameters, System, free_motions, refuse,
    refuse_tilt,
};
use crate::scene::Scene;

/// Frame velocities of motions that neither joints nor walls of the water stand against.
pub(super) fn free(scene: &Scene, coupled: bool, system: &System) -> Motions {
    let groups = groups(scene, coupled, system);
    free_motions(&system.tree, &system.drives, &groups).velocities
}

/// Those of them that nothing that acts at the parameters knows of either.
pub(super) fn kept(
    scene: &Scene,
    coupled: bool,
    system: &System,
    parameters: &Parameters,
) -> FreeMotions {
    let kept = |mut groups: Vec<Group>| {
        for group in &mut groups {
            group.refused += acting(system, parameters, &group.roots);
        }
        free_motions(&system.tree, &system.drives, &groups)
    };
    let groups = groups(scene, coupled, system);
    // Springs and what touches act between groups: all of them together then keep what each alone doesn't.
    let together = Group {
        roots: groups.iter().flat_map(|g| g.roots.clone()).collect(),
        refused: groups.iter().map(|g| g.refused).sum(),
    };
    let [apart, together] = [groups, vec![together]].map(kept);
    match together.twists.len() > apart.twists.len() {
        true => together,
        false => apart,
    }
}

/// Bodies in the same water, and each tree of joints outside of it.
fn groups(scene: &Scene, coupled: bool, system: &System) -> Vec<Group> {
    let links = system.tree.links();
    let mut wet = vec![false; links.len()];
    let root = roots(system);
    system.submerged().for_each(|(b, _)| wet[root[b]] = true);
    let roots = (0..links.len()).filter(|b| links[*b].parent.is_none());
    let (wet, apart): (Vec<usize>, Vec<usize>) = roots.partition(|b| coupled && wet[*b]);
    let walls = scene.walls.iter().map(|w| Vec3::from(w.normal));
    let wet = Group {
        roots: wet,
        refused: walls.map(|n| refuse(Outside::Along(n))).sum(),
    };
    let apart = apart.into_iter().map(|b| Group {
        roots: vec![b],
        refused: Mat6::zeros(),
    });
    std::iter::once(wet).chain(apart).collect()
}

/// Of each body the first one of its tree of joints.
fn roots(system: &System) -> Vec<usize> {
    let links = system.tree.links();
    let mut out: Vec<usize> = Vec::with_capacity(links.len());
    for (b, link) in links.iter().enumerate() {
        out.push(link.parent.map_or(b, |parent| out[parent]));
    }
    out
}

/// What acts on the bodies of these trees from outside.
fn acting(system: &System, parameters: &Parameters, roots: &[usize]) -> Mat6 {
    let links = system.tree.links();
    let mut chosen = vec![false; links.len()];
    roots.iter().for_each(|root| chosen[*root] = true);
    let bodies: Vec<bool> = self::roots(system)
        .iter()
        .map(|root| chosen[*root])
        .collect();
    let roots: Vec<_> = roots.iter().map(|b| links[*b].v.clone()).collect();
    let group = Together {
        bodies: &bodies,
        roots: &roots,
    };
    let forces = system.forces.iter();
    let mut outside: Vec<Outside> = forces.map(|f| f.outside(&group, parameters)).collect();
    let touched = |contact: &ContactModel| contact.shapes.reach_out(&bodies);
    if system.contact.as_ref().is_some_and(touched) {
        outside.push(Outside::All);
    }
    if system.limits.iter().any(|limit| group.hangs_on(limit.v)) {
        outside.push(Outside::All);
    }
    let mut refused: Mat6 = outside.into_iter().map(refuse).sum();
    if system.has_current() {
        refused += refuse_tilt(&system.current);
    }
    refused
}
