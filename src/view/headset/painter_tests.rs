//! Tests of `view::headset::painter`: the gate between the frames' thread and the panel's.

use super::*;

#[test]
fn calls_begin_only_while_the_gate_is_open_and_are_waited_for() {
    let gate = Arc::new(Gate::default());
    let (begun, has_begun) = channel();
    let (end, may_end) = channel::<()>();
    let there = Arc::clone(&gate);
    let thread = std::thread::spawn(move || {
        while let Some(call) = there.begin() {
            begun.send(()).expect("a listener");
            may_end.recv().expect("a word");
            drop(call);
        }
    });
    assert!(has_begun.recv_timeout(Duration::from_millis(20)).is_err(), "closed at first");
    // Nothing is under way: this returns.
    gate.wait();
    while !gate.lock().is_waiting {
        std::thread::yield_now();
    }
    gate.open();
    gate.close();
    assert!(gate.lock().is_calling, "its turn, however short the gate was open; closing does not wait for its end");
    has_begun.recv().expect("a call");
    end.send(()).expect("a call");
    gate.wait();
    assert!(!gate.lock().is_calling);
    assert!(has_begun.recv_timeout(Duration::from_millis(20)).is_err(), "none begins while it is closed");
    // The end also wakes who waits at a closed gate, and lets nobody in.
    gate.change(|state| state.is_over = true);
    thread.join().expect("an end");
    gate.open();
    assert!(gate.begin().is_none());
}
