//! The engine at work.

use core::hint::black_box;
use core::ops::Add;
use core::time::Duration;

use ringcat_engine::time::Instant;

/// Whether the engine's time adds up.
pub fn works() -> Option<()> {
    let add: fn(Instant, Duration) -> Instant = black_box(<Instant as Add<Duration>>::add);
    (add(Instant(1), Duration::from_millis(1)) == Instant(1_000_001)).then_some(())
}
