//! `hydrograd run --video`: a run as a video or pictures.
//!
//! These are pictures of a replay's page, and that is the Python package's: it hands in what makes them ([`Videos`]). A program without it hands the whole command to the
//! package's, so that nothing runs twice.

use clap::Args;
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::{Command, ExitStatus};
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use super::exit::Exit;
use super::interrupt;
use super::options::{choice, rate};
use crate::scene::Scene;
use crate::simulate::Rollout;
use crate::{Error, Result};

/// Names the Python that has the package, for a program that isn't the package's own.
const PYTHON: &str = "HYDROGRAD_PYTHON";

/// What is seen in a video besides bodies, walls and contacts.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, EnumMessage, EnumString, IntoStaticStr, VariantArray,
)]
#[strum(serialize_all = "kebab-case")]
pub enum Shown {
    /// Faces in colours by the pressure of the flow.
    Pressure,
    /// The same with the pressure of the water at rest.
    Hydrostatic,
    /// Arrows of the flow's forces and torques on bodies.
    Forces,
    /// Lines along the water's velocity around bodies.
    Streamlines,
    /// The page's panel, with its curve against time.
    Panel,
}

/// A video that is asked for of a run.
#[derive(Clone, Debug, Args)]
pub struct Video {
    /// Video of the run, by its name .mp4 or .webm, or a folder of PNG frames [default: none is made]. It needs the Python package with its extra `video` (`pip install
    /// '.[video]'`) and Chromium or Chrome; a hydrograd that isn't that package's hands the command to `python3 -m hydrograd`, or the Python that
    /// HYDROGRAD_PYTHON names.
    #[arg(id = "video", long = "video", value_name = "FILE.mp4|FILE.webm|FOLDER")]
    pub file: Option<PathBuf>,
    /// Frames in a second of the video.
    #[arg(id = "video_fps", long = "video-fps", value_name = "N", value_parser = rate, requires = "video", default_value = "30", allow_negative_numbers = true)]
    pub frames_per_second: f64,
    /// Simulated seconds in a second of the video: 0.1 is slow motion.
    #[arg(id = "video_speed", long = "video-speed", value_name = "X", value_parser = rate, requires = "video", default_value = "1", allow_negative_numbers = true)]
    pub speed: f64,
    /// Width and height in pixels, even numbers.
    #[arg(id = "video_size", long = "video-size", value_name = "WxH", value_parser = size, requires = "video", default_value = "1280x720")]
    pub size: [u32; 2],
    /// Direction from the scene to where it is seen from, world axes [default: from the front, a little from the right and from above].
    #[arg(id = "video_view", long = "video-view", value_name = "X,Y,Z", value_parser = direction, requires = "video", allow_hyphen_values = true)]
    pub view_from: Option<[f64; 3]>,
    /// How many times nearer the camera is than where it sees the whole scene.
    #[arg(id = "video_zoom", long = "video-zoom", value_name = "X", value_parser = rate, requires = "video", default_value = "1", allow_negative_numbers = true)]
    pub zoom: f64,
    /// The body that the camera goes along with [default: none].
    #[arg(
        id = "video_follow",
        long = "video-follow",
        value_name = "BODY",
        requires = "video"
    )]
    pub follow: Option<String>,
    /// What is seen besides bodies, walls and contacts, with commas between. All but panel take solves of their own a frame.
    #[arg(id = "video_show", long = "video-show", value_name = "WHAT", value_parser = choice::<Shown>(), value_delimiter = ',', requires = "video")]
    pub show: Vec<Shown>,
}

impl Video {
    /// Refuses a camera that goes along with a body that there isn't.
    pub(super) fn check(&self, scene: &Scene) -> Result<()> {
        let Some(followed) = &self.follow else {
            return Ok(());
        };
        let names: Vec<&str> = scene.bodies.iter().map(|b| b.name.as_str()).collect();
        match names.contains(&followed.as_str()) {
            true => Ok(()),
            false => Err(Error::input(
                "--video-follow",
                followed,
                format!("must be one of {names:?}"),
            )),
        }
    }
}

/// What makes videos: the Python package, whose replays they are pictures of. Errors are words for people.
pub trait Videos: Sync {
    /// Refuses what can't be made, for want of a program too, before a run's time is spent on it.
    ///
    /// # Errors
    /// Why it can't be made, and how it could.
    fn prepare(&self, video: &Video) -> std::result::Result<(), String>;

    /// Makes it, and gives its files to open.
    ///
    /// # Errors
    /// Why it wasn't made.
    fn record(&self, rollout: Rollout, video: &Video) -> std::result::Result<Vec<PathBuf>, String>;
}

/// Hands this command to the Python package, which must be of the same version.
///
/// # Errors
/// No such Python or package, by name, with what brings it.
pub(super) fn hand_over(arguments: &[OsString]) -> Result<Exit> {
    let python = std::env::var_os(PYTHON).unwrap_or_else(|| "python3".into());
    let ours = env!("CARGO_PKG_VERSION");
    let needed = |found: String| Error::Unsupported {
        what: "--video".into(),
        why: format!(
            "it is made by hydrograd's Python package, version {ours}, and {} {found}",
            python.display()
        ),
        instead: format!(
            "`pip install '.[video]'` in hydrograd's folder brings it; {PYTHON} names the Python that has it"
        ),
    };
    let asked = Command::new(&python)
        .args(["-c", "import hydrograd; print(hydrograd.__version__)"])
        .output();
    let found = match asked {
        Err(error) => return Err(needed(format!("doesn't start: {error}"))),
        Ok(done) if !done.status.success() => {
            let said = String::from_utf8_lossy(&done.stderr);
            let last = said.trim().lines().last().unwrap_or("it doesn't say why");
            return Err(needed(format!("doesn't have it: {last}")));
        }
        Ok(done) => String::from_utf8_lossy(&done.stdout).trim().to_string(),
    };
    if found != ours {
        return Err(needed(format!("has version {found}")));
    }
    // The package's command hears of Ctrl-C itself, and keeps what ran.
    interrupt::leave_to_another();
    let ended = Command::new(&python)
        .args(["-m", "hydrograd"])
        .args(arguments.iter().skip(1))
        .status();
    let ended = ended.map_err(|error| needed(format!("doesn't start: {error}")))?;
    Ok(match ended.code() {
        Some(0) => Exit::Done,
        Some(2) => Exit::Usage,
        _ => failed(ended),
    })
}

/// What ended it without a word of its own is said.
fn failed(ended: ExitStatus) -> Exit {
    if ended.code().is_none() {
        super::output::note(format_args!("the Python package's command: {ended}"));
    }
    Exit::Failed
}

/// Width and height.
fn size(text: &str) -> std::result::Result<[u32; 2], String> {
    let parts = text.split_once('x');
    let parts = parts.and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    parts.ok_or_else(|| "give width and height in pixels, e.g. 1280x720".into())
}

/// Three numbers that aren't all zero.
fn direction(text: &str) -> std::result::Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|x| x.trim().parse().ok()).collect();
    let found = numbers.and_then(|x| <[f64; 3]>::try_from(x).ok());
    let found = found.filter(|x| x.iter().all(|c| c.is_finite()) && *x != [0.0; 3]);
    found.ok_or_else(|| "give three numbers that aren't all zero, e.g. 1,-2,0.5".into())
}
