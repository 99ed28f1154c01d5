//! Overlaps of a few millimetres: as deep at every depth as the shortest way apart, and no other a hair's breadth away.

use super::cylinder::{distance, least};
use super::*;
use std::f64::consts::FRAC_PI_2;

/// Turns of two bodies, and where the second is beside the first.
type Placed = ([f64; 3], [f64; 3], [f64; 3]);

fn puck() -> Shape {
    Shape::cylinder(0.1, 0.1)
}

fn slab() -> Shape {
    Shape::cuboid([0.2, 0.2, 0.1])
}

fn roof() -> Shape {
    Shape::prism(vec![[-0.1, -0.05], [0.1, -0.05], [0.0, 0.1]], 0.2)
}

/// Moves the second body along the way between the two: wherever they overlap their least gap is the shortest way apart, some points weigh
/// together at least nearly one there, and shifts of 10⁻¹¹ m don't move it.
fn sweep(first: &Shape, second: &Shape, placed: &[Placed]) {
    let (a, b) = (plain(first), plain(second));
    let mut draw = Draw::new(17);
    let mut overlapping = 0;
    for (turn, beside, other) in placed {
        let rest = turned(*turn, [0.0; 3]);
        let way = Vec3::from(*beside);
        for k in 0..41 {
            let shift = -0.006 + 0.00025 * f64::from(k);
            let pose = Pose::new(
                exp_matrix(&Vec3::from(*other)),
                way + shift * way.normalize(),
            );
            let exact = distance(first, &rest, second, &pose);
            if exact > -1e-4 {
                continue;
            }
            overlapping += 1;
            let points = between(&a, &b, &rest, &pose, 0.01).unwrap();
            let gap = least(&points);
            assert!(
                (gap - exact).abs() < 5e-5,
                "{turn:?} {shift}: {gap:e} {exact:e}"
            );
            let deep = points.iter().filter(|p| p.gap < 0.98 * exact);
            let weight: f64 = deep.map(|p| p.weight).sum();
            assert!(weight > 0.9, "{turn:?} {shift}: {weight}");
            for _ in 0..6 {
                let mut there = pose;
                there.translation += 1e-11 * draw.vector();
                let points = between(&a, &b, &rest, &there, 0.01).unwrap();
                let error = least(&points) - gap;
                assert!(error.abs() < 1e-9, "{turn:?} {shift}: {error:e} {gap:e}");
            }
        }
    }
    assert!(overlapping > 15 * placed.len(), "{overlapping}");
}

#[test]
fn an_edge_that_pierces_the_end_of_a_cylinder_keeps_its_point() {
    let placed = [
        (
            [-0.539863937176515, 0.10652377706203, 0.562982582325523],
            [0.213636475405488, -0.0257121962496123, -0.0885169201824398],
            [-0.0177422367032936, 0.301635233173236, 0.426104766134569],
        ),
        (
            [0.594925861846824, -0.91209976232621, 0.379989781846741],
            [0.161260619810224, -0.127233673424135, -0.086797163057327],
            [0.173369989620097, -1.24181330600271, 1.55341286694012],
        ),
        (
            [0.902850701113593, -1.21505373128392, -2.81929143843077],
            [-0.0530356726190467, -0.123712724893665, -0.1532712048868],
            [0.135331118402417, 0.261963090101848, 0.720299635608895],
        ),
    ];
    sweep(&puck(), &slab(), &placed);
    // The third had no point from 0.5 to 8.8 mm: the search around the rim ran to another place.
    let placed = [
        (
            [0.0265695854030119, -0.0823621158441471, 0.756112935582365],
            [-0.0814053780295695, -0.0937212365906657, 0.105033599323679],
            [0.562259028195235, -0.589707746353871, -0.823527057213281],
        ),
        (
            [0.590284496310667, 0.718192255970231, -0.456308495463091],
            [0.105505598550428, 0.170769572227439, 0.00687034180095367],
            [0.777327963654348, 1.07081059372626, -0.158365734755816],
        ),
        (
            [-1.08258964586799, -1.01063887272647, -0.00861059730177641],
            [0.110775311264589, -0.0915422099554563, 0.0247952940277349],
            [-1.00730918641929, 0.493463852910078, 0.587250785843145],
        ),
    ];
    sweep(&puck(), &roof(), &placed);
}

#[test]
fn two_rims_that_overlap_keep_their_point() {
    let placed = [
        (
            [1.68233482244392, -1.10797633199277, -0.684907833928556],
            [-0.0846362012813762, -0.0909500165214402, -0.141951312562274],
            [0.352208225752542, 0.414349810550306, 0.0834614562818916],
        ),
        (
            [0.0194471732233199, -0.360978735493744, -0.542694940476649],
            [-0.0416957628708548, 0.184195128478216, -0.0267940425992296],
            [-1.0935095073903, -0.250141928688451, -0.175058005186116],
        ),
    ];
    sweep(&puck(), &puck(), &placed);
}

#[test]
fn an_edge_through_the_middle_of_a_coin_is_as_deep_as_it_is() {
    let placed = [
        (
            [-0.243558679079105, 1.00231360127569, -0.886459943160587],
            [0.00603023942534325, 0.0441546685430061, -0.186353913901177],
            [-0.291720232439864, 0.882538967456484, 0.580350016190899],
        ),
        (
            [0.229153905213263, -2.49389427845799, 0.690124770162812],
            [-0.0680641918304565, 0.0534588283737875, -0.143609583895439],
            [0.491368260744991, -1.63885714389049, 0.0613535098381716],
        ),
        (
            [-2.03950383759464, -0.340316624702377, -0.60861061591293],
            [0.105933875594891, -0.129274198485262, -0.0971537577354995],
            [0.532721599889039, -2.27902648905533, 1.17449867900919],
        ),
        (
            [0.146350360066452, 1.03126079607866, 0.164314878534798],
            [0.0265801781588116, -0.0374620535790244, -0.219034890986063],
            [0.624325112184876, 1.63217419557513, 0.270026447178852],
        ),
    ];
    sweep(&Shape::ellipsoid([0.1, 0.1, 0.01]), &slab(), &placed);
}

#[test]
fn what_lies_along_the_tangent_of_a_rim_is_held() {
    let bed = plain(&puck());
    let tops = [Shape::capsule(0.04, 0.3), Shape::cylinder(0.04, 0.4)];
    for top in tops.iter().map(plain) {
        for k in 0..61 {
            let aside = 0.085 + 5e-4 * f64::from(k);
            for gap in [2e-3f64, -1e-3, -1e-2] {
                let past = f64::max(aside - 0.1, 0.0);
                let height = 0.05 + f64::sqrt((0.04 + gap).powi(2) - past * past);
                let pose = turned([FRAC_PI_2, 0.0, 0.0], [aside, 0.0, height]);
                let evaluate = |g: &Pose| between(&top, &bed, g, &Pose::identity(), 0.01).unwrap();
                let points = evaluate(&pose);
                let found = least(&points);
                assert!((found - gap).abs() < 1e-9, "{aside} {gap}: {points:#?}");
                let near = points.iter().filter(|p| p.gap < gap + 1e-6);
                let weight: f64 = near.map(|p| p.weight).sum();
                assert!(weight > 0.99, "{aside} {gap}: {weight} {points:#?}");
                // Aslant, where nothing is level; the normal bends at once as the axis passes the rim.
                let slant = Pose::new(
                    exp_matrix(&Vec3::new(0.013, 0.021, 0.2)) * pose.rotation,
                    pose.translation,
                );
                let error = super::slopes::slope_error(evaluate, &slant);
                assert!(error < 1e-5, "{aside} {gap}: {error:e}");
            }
        }
    }
}
