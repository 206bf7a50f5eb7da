//! A snapshot of the MainDevice as JSON and back. A test program of its own: `serde_json` adds comparisons that make
//! others ambiguous.

use ringcat::Snapshot;
use ringcat_sim::network::NetworkOptions;
use scenarios::segments::{descriptions, ring};
use scenarios::world::World;

// covers: jobs
#[test]
fn a_snapshot_survives_json() {
    let network = ring(descriptions(&["coupler", "all-protocols", "digital-input-8"]), NetworkOptions::default());
    let mut world = World::in_op(1, network);
    let state = world.application_mut().engine_mut().snapshot();
    let json = serde_json::to_string(&state).expect("plain numbers and names");
    assert!(json.contains(r#""activity":"active""#) && json.contains(r#""progress":"settled""#), "{json}");
    assert_eq!(serde_json::from_str::<Snapshot>(&json).expect("the same"), state);
}
