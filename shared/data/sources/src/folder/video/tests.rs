use super::*;
use std::os::unix::fs::PermissionsExt;
use std::process::Command;

/// A video of uneven times, whose frames are all different; `None`, with the reason printed, without ffmpeg.
pub(in crate::folder) fn video(folder: &Path, n_frames: u64) -> Option<PathBuf> {
    let path = folder.join("rgb.mp4");
    let source =
        "testsrc2=size=64x48:rate=30,noise=alls=60:allf=t,select='not(eq(n\\,3)+eq(n\\,7))',setpts=PTS+0";
    let made = Command::new("ffmpeg")
        .args(["-nostdin", "-v", "error", "-f", "lavfi", "-i", source, "-frames:v"])
        .arg(n_frames.to_string())
        .args(["-fps_mode", "passthrough", "-pix_fmt", "yuv420p", "-g", "5"])
        .arg(&path)
        .status();
    if !made.is_ok_and(|status| status.success()) {
        eprintln!("skipped: there is no ffmpeg (5.1 or newer) on this machine");
        return None;
    }
    Some(path)
}

#[test]
fn each_frame_is_the_same_in_whatever_order() {
    let folder = tempfile::tempdir().unwrap();
    if video(folder.path(), 40).is_none() {
        return;
    }
    let open = || Video::open(folder.path(), "rgb.mp4").unwrap();
    let sequential = open();
    assert_eq!((sequential.n_frames, sequential.size), (40, (64, 48)));
    let frames: Vec<Vec<u8>> = (0..40).map(|k| sequential.read(k).unwrap()).collect();
    assert!(frames.windows(2).all(|pair| pair[0] != pair[1]));
    let other = open();
    // After all frames that are kept come later ones, an early one.
    for k in [5, 4, 11, 11, 0, 39, 2, 30, 6] {
        assert!(other.read(k).unwrap() == frames[k as usize], "{k}");
    }
    // As a sensor that was started again.
    let (again, mut n_alive) = (open(), 0);
    again.go_to(9, &mut || n_alive += 1);
    assert!(again.read(9).unwrap() == frames[9]);
    // As where the next stage was: an earlier frame is asked for.
    again.go_to(3, &mut || n_alive += 1);
    assert!(again.read(3).unwrap() == frames[3]);
    assert_eq!(n_alive, 9 + 3);
    assert_eq!(again.number_of(&again.name_of(39)), Some(39));
    assert_eq!((again.number_of(Path::new("rgb.mp4/40")), again.number_of(Path::new("rgb/1"))), (None, None));
}

#[test]
fn an_older_ffmpeg_is_told_otherwise_and_its_absence_is_named() {
    let folder = tempfile::tempdir().unwrap();
    if video(folder.path(), 12).is_none() {
        return;
    }
    let old = folder.path().join("old");
    let script = "#!/bin/sh\ncase \"$*\" in *fps_mode*) echo \"Unrecognized option 'fps_mode'.\" >&2; exit 1;; esac\nexec ffmpeg \"$@\"\n";
    std::fs::write(&old, script).unwrap();
    std::fs::set_permissions(&old, std::fs::Permissions::from_mode(0o755)).unwrap();
    let by_old = Video::open_with(folder.path(), "rgb.mp4", old.to_str().unwrap()).unwrap();
    assert!(by_old.read(7).unwrap() == Video::open(folder.path(), "rgb.mp4").unwrap().read(7).unwrap());
    let absent = Video::open_with(folder.path(), "rgb.mp4", "no-such-ffmpeg").unwrap_err();
    assert_eq!(absent, "there is no no-such-ffmpeg on this machine");
}

#[test]
fn what_is_damaged_or_no_video_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let Some(path) = video(folder.path(), 12) else { return };
    let whole = std::fs::read(&path).unwrap();
    // A list of other files is none.
    std::fs::write(&path, "#EXTM3U\n#EXTINF:1,\nhttp://192.0.2.1/a.ts\n").unwrap();
    assert!(Video::open(folder.path(), "rgb.mp4").unwrap_err().starts_with("ffmpeg: "));
    // Damage in the middle of the pictures, which lie between both boxes.
    let begin = whole.windows(4).position(|bytes| bytes == b"mdat").unwrap();
    let end = whole.windows(4).position(|bytes| bytes == b"moov").unwrap();
    let mut torn = whole;
    let middle = begin + (end - begin) * 2 / 3;
    torn[middle..end - 8].fill(0xff);
    std::fs::write(&path, &torn).unwrap();
    let video = Video::open(folder.path(), "rgb.mp4").unwrap();
    let errors: Vec<u64> = (0..12).filter(|k| video.read(*k).is_err()).collect();
    assert!(!errors.is_empty() && errors == (errors[0]..12).collect::<Vec<u64>>(), "{errors:?}");
    assert!(video.read(11).unwrap_err().to_string().contains("ffmpeg: "));
}
