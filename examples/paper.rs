//! Figures of the paper, made again: pictures, and the numbers that docs/paper.md gives.
//!
//! ```text
//! cargo run --release --example paper -- FIGURE… [--quick] [--json] [--out FOLDER]
//! ```
//!
//! FIGURE is `fig1` (a coin grasped under water), `fig3` (the falling ball, with the water coupled and without), `fig4` (the same with more and less viscosity), `fig6` (how preconditioners converge), `fig7`
//! (a cube that is pushed and let go), `fig8` (a swimmer that passes a small fish), `fig9` (the swimmer beside a large beating tail), `fig10` (what the solve of Eq. 20 and its gradient cost), `table1`
//! (what steps cost), `steer` (the swimmer's way past the tail straightened by gradients), `gait` (its gait, for less work of its motors, by gradients) or `all`. Pictures are written to FOLDER as
//! `paper_fig4.svg` and so on; `--quick` takes coarse meshes and short runs; `--json` prints the numbers alone, one object by figure.

#[path = "paper/bars.rs"]
mod bars;
#[path = "paper/course.rs"]
mod course;
#[path = "paper/dense.rs"]
mod dense;
#[path = "paper/falling.rs"]
mod falling;
#[path = "paper/fig1.rs"]
mod fig1;
#[path = "paper/fig10.rs"]
mod fig10;
#[path = "paper/fig3.rs"]
mod fig3;
#[path = "paper/fig4.rs"]
mod fig4;
#[path = "paper/fig6.rs"]
mod fig6;
#[path = "paper/fig7.rs"]
mod fig7;
#[path = "paper/fig8.rs"]
mod fig8;
#[path = "paper/fig9.rs"]
mod fig9;
#[path = "paper/gait.rs"]
mod gait;
#[path = "paper/meshed.rs"]
mod meshed;
#[path = "paper/operator.rs"]
mod operator;
#[path = "paper/plot.rs"]
mod plot;
#[path = "paper/rival.rs"]
mod rival;
#[path = "paper/spent.rs"]
mod spent;
#[path = "paper/sqp.rs"]
mod sqp;
#[path = "paper/steer.rs"]
mod steer;
#[path = "paper/swim.rs"]
mod swim;
#[path = "paper/table1.rs"]
mod table1;
#[path = "paper/work.rs"]
mod work;

use serde_json::{Map, Value};
use std::error::Error;
use std::path::{Path, PathBuf};

/// What a figure comes to: its numbers by name.
type Numbers = Map<String, Value>;
type Made = Result<Numbers, Box<dyn Error>>;

/// How a figure is made.
struct How<'a> {
    /// With coarse meshes and short runs.
    quick: bool,
    /// Where its picture goes.
    picture: &'a Path,
}

type Figure = (&'static str, fn(&How) -> Made);

/// Each by its name.
const FIGURES: [Figure; 11] = [
    ("fig1", fig1::make),
    ("fig3", fig3::make),
    ("fig4", fig4::make),
    ("fig6", fig6::make),
    ("fig7", fig7::make),
    ("fig8", fig8::make),
    ("fig9", fig9::make),
    ("fig10", fig10::make),
    ("table1", table1::make),
    ("steer", steer::make),
    ("gait", gait::make),
];

/// What the command line asks for.
struct Options {
    figures: Vec<usize>,
    quick: bool,
    json: bool,
    out: PathBuf,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if table1::serve(&arguments)? {
        return Ok(());
    }
    let options = options(arguments.into_iter())?;
    std::fs::create_dir_all(&options.out)
        .map_err(|e| format!("--out {}: {e}", options.out.display()))?;
    let mut all = Map::new();
    for &k in &options.figures {
        let (name, make) = FIGURES[k];
        let picture = options.out.join(format!("paper_{name}.svg"));
        let quick = options.quick;
        let picture = picture.as_path();
        let numbers = make(&How { quick, picture })?;
        if !options.json {
            println!("{name}: {}", picture.display());
            for (what, value) in &numbers {
                println!("  {what}: {value}");
            }
        }
        all.insert(name.into(), Value::Object(numbers));
    }
    if options.json {
        println!("{}", serde_json::to_string_pretty(&all)?);
    }
    Ok(())
}

fn options(mut arguments: impl Iterator<Item = String>) -> Result<Options, String> {
    let mut out = Options {
        figures: Vec::new(),
        quick: false,
        json: false,
        out: ".".into(),
    };
    while let Some(given) = arguments.next() {
        match given.as_str() {
            "--quick" => out.quick = true,
            "--json" => out.json = true,
            "--out" => out.out = arguments.next().ok_or("--out needs a folder")?.into(),
            "all" => out.figures.extend(0..FIGURES.len()),
            name => match FIGURES.iter().position(|(known, _)| *known == name) {
                Some(k) => out.figures.push(k),
                None => {
                    let names = FIGURES.map(|(name, _)| name).join(", ");
                    return Err(format!(
                        "{name}: expected {names}, all, --quick, --json or --out FOLDER"
                    ));
                }
            },
        }
    }
    if out.figures.is_empty() {
        return Err("name a figure, or `all`".into());
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quick(name: &str) -> Numbers {
        let folder = tempfile::tempdir().unwrap();
        let picture = folder.path().join("figure.svg");
        let (_, make) = FIGURES.iter().find(|(known, _)| *known == name).unwrap();
        let made = make(&How {
            quick: true,
            picture: &picture,
        });
        let drawn = std::fs::read_to_string(&picture).unwrap();
        assert!(drawn.starts_with("<svg") && drawn.len() > 5000, "{name}");
        made.unwrap()
    }

    #[test]
    fn a_descent_catches_what_the_naive_push_loses_in_water() {
        let numbers = quick("fig1");
        let of = |name: &str, what: &str| numbers[name][what].as_f64().unwrap();
        for (name, caught) in [("naive_dry", true), ("naive", false), ("optimised", true)] {
            assert_eq!(numbers[name]["caught"], caught, "{numbers:?}");
            assert!(of(name, "smallest_gap_m") > 0.0, "{numbers:?}");
        }
        // Beyond the tips, with the gripper nearly where it was; what catches it follows it.
        assert!(of("naive_dry", "coin_pushed_m").abs() < 1e-9);
        assert!(of("naive", "coin_pushed_m") > 0.2 && of("naive", "gripper_moved_m") < 0.1);
        assert!(of("naive", "coin_along_the_fingers_m") > 1.6);
        assert!(of("optimised", "gripper_moved_m") > 0.1, "{numbers:?}");
        assert!(
            numbers["cost_cut_by"].as_f64().unwrap() > 10.0,
            "{numbers:?}"
        );
    }

    #[test]
    fn the_water_turns_the_coin_and_only_the_water() {
        let numbers = quick("fig3");
        let turned = |name: &str| numbers[name]["turned_at_most_deg"].as_f64().unwrap();
        assert!(turned("full") > 1.0 && turned("reduced") > 1.0);
        assert!((turned("full") / turned("reduced") - 1.0).abs() < 0.2);
        assert!(turned("isolated").abs() < 1e-9);
        for name in ["full", "reduced", "isolated"] {
            assert!(numbers[name]["sphere_arrives_s"].as_f64().unwrap() > 1.0);
        }
    }

    #[test]
    fn more_viscosity_pushes_less_far_and_settles_sooner() {
        let numbers = quick("fig4");
        assert_eq!(numbers["push_falls_with_viscosity"], true, "{numbers:?}");
        assert_eq!(
            numbers["settles_sooner_with_viscosity"], true,
            "{numbers:?}"
        );
    }

    #[test]
    fn better_preconditioners_take_fewer_iterations() {
        let numbers = quick("fig6");
        let of = |name: &str| {
            let reached = &numbers[name]["iterations_to_2.7e-3"];
            reached
                .as_u64()
                .unwrap_or_else(|| panic!("{name}: {numbers:?}"))
        };
        // The paper's count.
        assert!(of("CSD24, rho 1.2") <= 59 && of("CSD24, rho 3") <= 59);
        assert!(3 * of("CSD24, rho 3") < of("Jacobi"));
        assert!(of("CSD24, rho 3") < of("CSD24, rho 1.2"));
        assert!(of("factors per body") < of("CSD24 per body, rho 3"));
    }

    #[test]
    fn a_cube_glides_on_without_drag_and_with_it_as_in_closed_form() {
        let numbers = quick("fig7");
        let of = |name: &str, what: &str| numbers[name][what].as_f64().unwrap();
        assert!(of("none", "speed_lost").abs() < 1e-9);
        for (name, most) in [("none", 1e-9), ("eq22", 1e-6), ("frontal", 1e-6)] {
            assert!(of(name, "off_by") < most, "{name}: {}", of(name, "off_by"));
            assert!(of(name, "aside_m") < 1e-9);
        }
        assert!(of("frontal", "energy_left") < of("none", "energy_left"));
    }

    #[test]
    fn a_small_fish_is_pushed_by_the_water_alone() {
        let numbers = quick("fig8");
        let of = |name: &str, what: &str| numbers[name][what].as_f64().unwrap();
        assert!(of("coupled", "small_fish_pushed_m") > 5e-3, "{numbers:?}");
        assert!(of("uncoupled", "small_fish_pushed_m") < 1e-9);
        assert!(of("coupled", "smallest_gap_m") > 0.0);
        // The trailing edge is what drives the swimmer.
        assert!(of("alone", "way_m") > 10.0 * of("alone_without_edge", "way_m").abs());
    }

    #[test]
    fn a_beating_tail_makes_the_swimmer_drift() {
        let numbers = quick("fig9");
        let drift = |name: &str| numbers[name]["lateral_drift_m"].as_f64().unwrap().abs();
        assert!(drift("coupled") > 3.0 * drift("uncoupled"), "{numbers:?}");
        assert!(numbers["coupled"]["smallest_gap_m"].as_f64().unwrap() > 0.0);
    }

    #[test]
    fn all_ways_through_the_inverse_agree_and_ours_holds_least() {
        let numbers = quick("fig10");
        for method in ["pseudo_inverse", "least_squares", "pcg", "ours"] {
            let sizes = numbers[method]["sizes"].as_array().unwrap();
            assert_eq!(sizes.len(), 3, "{method}");
            for size in sizes {
                let off = size["gradient_off_by"].as_f64().unwrap();
                assert!(off < 1e-8, "{method}: {size}");
            }
        }
        let held = |method: &str| numbers[method]["sizes"][2]["megabytes"].as_f64().unwrap();
        assert!(held("least_squares") > 2.0 * held("ours"), "{numbers:?}");
    }

    #[test]
    fn costs_of_steps_add_up() {
        let numbers = quick("table1");
        for scene in ["falling_ball_box", "grasp_open"] {
            let of = |name: &str, what: &str| numbers[scene][name][what].as_f64().unwrap();
            for name in ["preset_paper", "full", "reduced", "auto"] {
                let parts = ["forward_s", "backward_s", "others_s"].map(|part| of(name, part));
                let total = of(name, "total_s");
                assert!((parts.iter().sum::<f64>() - total).abs() < 1e-12, "{name}");
                assert_eq!(of(name, "bodies"), of("paper", "bodies"), "{scene}, {name}");
            }
        }
    }

    #[test]
    fn gradients_find_the_way_back() {
        let numbers = quick("steer");
        assert!(numbers["cut_by"].as_f64().unwrap() > 10.0, "{numbers:?}");
    }

    #[test]
    fn gradients_find_a_gait_of_less_work() {
        let numbers = quick("gait");
        let of = |name: &str| numbers[name].as_f64().unwrap();
        let kept = of("distance_kept");
        assert!(of("better_by") > 1.7 && kept > 0.999, "{numbers:?}");
        assert!(of("better_by") > of("better_by_cmaes"), "{numbers:?}");
    }

    #[test]
    fn what_is_asked_for_must_be_there() {
        let asked = |words: &[&str]| options(words.iter().map(|w| (*w).to_string()));
        let error = |words: &[&str]| asked(words).err().unwrap();
        let names = FIGURES.map(|(name, _)| name).join(", ");
        assert!(error(&["fig2"]).contains(&format!("fig2: expected {names}, all")));
        assert!(error(&[]).contains("name a figure"));
        assert!(error(&["--out"]).contains("--out needs a folder"));
        assert_eq!(
            asked(&["all", "--quick"]).unwrap().figures,
            (0..FIGURES.len()).collect::<Vec<_>>()
        );
    }
}
