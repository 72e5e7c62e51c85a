//! The layout that a recording opens in.

use re_sdk::blueprint::components::PanelState;
use re_sdk::blueprint::{
    Blueprint, BlueprintPanel, Horizontal, SelectionPanel, Spatial2DView, Spatial3DView, TextLogView,
    TimePanel, TimeSeriesView, Vertical,
};

/// The map at the left; image, plots and states at the right.
pub(crate) fn blueprint() -> Blueprint {
    let right = Vertical::new([
        Spatial2DView::new("Camera").with_origin("world/camera/image").into(),
        TimeSeriesView::new("Latency, ms").with_origin("latency").into(),
        TimeSeriesView::new("Standard deviation, mm").with_origin("certainty").into(),
        TextLogView::new("States").with_origin("states").into(),
    ]);
    let right = right.with_row_shares([3.0, 2.0, 1.0, 1.0]);
    let map = Spatial3DView::new("Map").with_origin("world");
    let all = Horizontal::new([map.into(), right.into()]).with_column_shares([2.0, 1.0]);
    Blueprint::new(all)
        .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Collapsed))
        .with_selection_panel(SelectionPanel::from_state(PanelState::Collapsed))
        .with_time_panel(TimePanel::new().with_timeline("frame"))
}
