//! The program as its users meet it: real processes over real shared memory, and the outputs' bytes.
//!
//! One executable, so that the program's crates are linked once. A part of it runs by a piece of its
//! path: `cargo test --test end_to_end durability`.

mod common;
#[path = "../requirements.rs"]
mod requirements;

/// What is promised whatever happens: the table of invariants in docs/internals.md, test by test.
mod promises {
    /// A result is a function of input and settings, never of time, threads or machine.
    mod determinism {
        mod isa;
        mod one_process;
        mod profile;
    }
    /// What was acknowledged stays: deaths, interruptions and ends change no byte and leave nothing.
    mod durability {
        mod chaos;
        mod deaths;
        mod ends;
        mod power;
        mod random_kills;
        mod resume;
        mod saved_map;
        mod sleeps;
        mod submaps;
        mod systemd;
        mod turned_off;
        mod versions;
    }
    /// A fault stays where it is: in one stage, one frame, one viewer, one foreign program.
    mod isolation {
        mod base;
        mod garbage;
        mod live_faults;
        mod poison;
        mod rerun;
        mod strangers;
        mod viewers;
        mod web;
    }
    /// Work, memory, disk and delay have bounds, and each too small machine its outcome.
    mod bounds {
        mod growth;
        mod onboard;
        mod overload;
        mod small_machines;
        mod zero_copy;
    }
    /// Outputs are functions of the run directory.
    mod outputs {
        mod exports;
        mod models;
        mod refine_camera;
        mod report;
        mod report_scene;
        mod run_directory;
        mod submaps;
        mod trace;
        mod verdict;
    }
    /// The manual tells what is there.
    mod documentation {
        mod made_elsewhere;
        mod manual;
        mod messages;
        mod numbers;
        mod small_recording;
        mod told;
    }
}

/// What the program meets the world with.
mod interfaces {
    /// Arguments, settings, the terminal.
    mod command_line {
        mod ablate;
        mod arguments;
        mod bad_input;
        mod terminal;
        mod top;
    }
    /// Recordings and all other bytes from outside.
    mod files {
        mod bags;
        mod fetch_tum;
        mod fuzz_corpus;
        mod objects;
        mod record3d;
        mod recordings;
    }
    /// Cameras' own programs, in Rust, C, C++ and Python.
    mod camera {
        mod camera_interface;
        mod external;
        mod foreign_camera;
        mod realsense;
        mod vendor_cameras;
    }
}
