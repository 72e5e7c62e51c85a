//! Another program of the same user writes nonsense into a run's services: it is refused, counted
//! and logged, and changes nothing.

use crate::common::{room, signal};
use tessera_messages::{FrameHeader, Kind, SurfaceHeader};
use tessera_settings::Settings;
use tessera_stage::{RunFile, RunFiles};
use tessera_transport::Link;

const FRAMES: u64 = 150;

#[test]
fn nonsense_is_refused_and_changes_nothing() {
    let undisturbed = room().frames(FRAMES);
    assert!(undisturbed.finish().success());
    // The aligner stops in the middle, which is not taken for a hang: time to write nonsense.
    let run = room().frames(FRAMES).with(&["--set", "flow.hang_s=600"]).with_faults("align=computed:20:stop");
    let mut child = run.start();
    let align = run.wait_until_stopped("align");
    let files = RunFiles::new(&run.out());
    let file = RunFile::read(&files).unwrap();
    let config = std::fs::read_to_string(files.config()).unwrap();
    let settings = Settings::from_toml(&config, "config").unwrap();
    let layout = file.layout(&settings);
    let link = Link::open(&file.identity, &layout, "vandal").unwrap();
    let frames = link.frame_publisher().unwrap();
    let good = FrameHeader {
        index: 1 << 40,
        epoch: u64::MAX,
        width: layout.frame.width,
        height: layout.frame.height,
        ..FrameHeader::default()
    };
    let end = Kind::End.to_wire();
    let nonsense = [
        good,
        FrameHeader { width: 7, index: 3, ..good },
        FrameHeader { kind: 99, index: 3, ..good },
        FrameHeader { kind: end, index: FRAMES / 2, ..good },
        FrameHeader { height: u32::MAX, index: u64::MAX, ..good },
    ];
    for header in nonsense {
        let mut loan = frames.loan(layout.frame.payload_len()).unwrap();
        *loan.header_mut() = header;
        loan.send().unwrap();
    }
    // A payload that is too short for what its header says.
    let mut loan = frames.loan(5).unwrap();
    *loan.header_mut() = FrameHeader { index: FRAMES - 1, ..good };
    loan.send().unwrap();
    let surfaces = link.surface_publisher().unwrap();
    let good = SurfaceHeader {
        index: 1 << 40,
        width: layout.grid.width as u32,
        height: layout.grid.height as u32,
        step: layout.grid.step as u32,
        ..SurfaceHeader::default()
    };
    let send = |header: SurfaceHeader, len: usize, x: f32| {
        let mut loan = surfaces.loan(len).unwrap();
        *loan.header_mut() = header;
        loan.payload_mut()[0].position[0] = x;
        loan.send().unwrap();
    };
    send(good, layout.grid.len(), 0.0);
    for index in 0..3 * FRAMES {
        send(SurfaceHeader { index, ..good }, layout.grid.len(), f32::NAN);
    }
    send(SurfaceHeader { index: FRAMES - 1, ..good }, 4, 0.0);
    // The ports stay open: what was sent to a reader that never looked while they were is gone.
    signal(align, "CONT");
    assert!(child.wait().unwrap().success(), "{}", run.log());
    drop((frames, surfaces, link));
    assert!(run.log().contains("refused"), "{}", run.log());
    run.assert_same_bytes(&undisturbed, "nonsense in the services");
}
