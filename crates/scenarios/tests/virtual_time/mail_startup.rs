//! Start-up lists of many drives at once: how their mail shares the wire.

use std::time::Duration;

use scenarios::start_lists::Lists;

// covers: layout, start-lists
#[test]
fn a_hundred_drives_start_in_little_more_time_than_one() {
    let all = Lists { drives: 100, objects: 50, mailbox: 128, period: Duration::from_millis(1) };
    let (one, cost) = (Lists { drives: 1, ..all }.start(), all.start());
    let floor = one.time.max(all.mail_alone());
    let ratio = cost.time.as_secs_f64() / floor.as_secs_f64();
    println!("one drive {:?}, all {cost:?}, ratio to the larger of one drive and the wire time {ratio:.2}", one.time);
    assert!(ratio < 1.5, "{ratio}");
    assert!(cost.mail.empty_reads < 500, "{:?}", cost.mail);
}
