//! Recording a stage's input: the whole pipeline in one process, whose bits are those of four.

use super::recording::{Begin, Entry, RecordingWriter, to_bytes};
use serde_bytes::ByteBuf;
use std::path::Path;
use tessera_journal::fingerprint;
use tessera_messages::Stage;
use tessera_offline::{Method, RawFrame, Run};
use tessera_outputs::ToolError;
use tessera_settings::Settings;
use tessera_slam::AlignRecord;
use tessera_sources::Source;

/// Writes the input of `stage` over a whole source; `tell` hears of each frame. Answers the bytes
/// of the file.
///
/// # Errors
/// Where a frame cannot be read or the file cannot be written.
pub fn record(
    source: &dyn Source,
    settings: &Settings,
    stage: Stage,
    path: &Path,
    tell: &mut dyn FnMut(),
) -> Result<u64, ToolError> {
    let camera = source.camera();
    let (stage_name, config) = (stage.name().into(), settings.to_toml()?);
    let stamp_sigma_s = source.pairing().stamp_sigma_s();
    let begin = Begin { stage: stage_name, config, camera: camera.clone(), stamp_sigma_s };
    let mut writer = RecordingWriter::create(path, begin)?;
    let method = Method {
        surface: settings.surface.clone(),
        registration: settings.registration.clone(),
        mapping: settings.mapping.clone(),
    };
    let wrong = |error: &dyn std::fmt::Display| ToolError::Arguments(error.to_string());
    let mut run = Run::stamped(camera, &method, stamp_sigma_s).map_err(|error| wrong(&error))?;
    let mut tap = Tap { stage, writer: &mut writer, previous: ByteBuf::new(), n_records: 0, n_answers: 0 };
    let n_frames = source.n_frames().unwrap_or(u64::MAX);
    for index in 0..n_frames {
        let frame = RawFrame::read(source, index)?;
        run.push(&frame);
        tap.frame(&run, &frame)?;
        tell();
    }
    let n_before = run.records().len();
    let records = run.finish().records;
    tap.tail(&records[n_before..])?;
    writer.finish(n_frames)
}

/// Takes from the run what the stage gets.
struct Tap<'a> {
    stage: Stage,
    writer: &'a mut RecordingWriter,
    /// The surface of the frame before, which a keyframe may be made of (optimise).
    previous: ByteBuf,
    n_records: usize,
    n_answers: u64,
}

impl Tap<'_> {
    fn frame(&mut self, run: &Run, frame: &RawFrame) -> Result<(), ToolError> {
        let records = &run.records()[self.n_records..];
        self.n_records = run.records().len();
        let vertices = to_bytes(run.last_surface(), run.last_features());
        match self.stage {
            Stage::Reconstruct => self.writer.add(&Entry::Image {
                depth: ByteBuf::from(bytemuck::cast_slice::<_, u8>(&frame.depth).to_vec()),
                colour: frame.colour.clone().map(ByteBuf::from),
                expected: fingerprint(&vertices)?,
            }),
            Stage::Align => {
                for record in records {
                    match record {
                        AlignRecord::Correction(applied) => {
                            self.writer.add(&Entry::Correction(applied.clone()))?;
                        }
                        AlignRecord::Frame(of) => self.writer.add(&Entry::Surface {
                            index: of.index,
                            stamp_nanos: frame.stamp_nanos,
                            rotation: frame.rotation,
                            up: frame.up,
                            vertices: vertices.clone(),
                            expected: fingerprint(record)?,
                        })?,
                        _ => {}
                    }
                }
                Ok(())
            }
            _ => {
                for record in records {
                    if let AlignRecord::Frame(of) = record
                        && let Some(keyframe) = &of.change.new_keyframe
                    {
                        let is_own = keyframe.frame_index == of.index;
                        let surface = if is_own { &vertices } else { &self.previous };
                        self.writer.add(&Entry::Keyframe(surface.clone()))?;
                    }
                    self.writer.add(&Entry::Record(Box::new(record.clone())))?;
                }
                self.previous = vertices;
                if let Some(correction) = run.correction().filter(|c| c.request >= self.n_answers) {
                    self.n_answers = correction.request + 1;
                    self.writer.add(&Entry::Answer(fingerprint(correction)?))?;
                }
                Ok(())
            }
        }
    }

    /// What comes after the last frame.
    fn tail(&mut self, records: &[AlignRecord]) -> Result<(), ToolError> {
        if self.stage != Stage::Optimise {
            return Ok(());
        }
        for (place, record) in records.iter().enumerate() {
            let is_end = matches!(record, AlignRecord::End { .. });
            self.writer.add(&Entry::Record(Box::new(record.clone())))?;
            if is_end && let Some(AlignRecord::Correction(applied)) = records.get(place + 1) {
                self.writer.add(&Entry::Answer(fingerprint(&applied.correction)?))?;
            }
        }
        Ok(())
    }
}
