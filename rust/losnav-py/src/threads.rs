//! Work for all cores, the calling one included.
use std::sync::Mutex;

/// Does every piece of work, on this thread and the pool's. This thread stays busy: were it to sleep until the pool is
/// done, the system would wake all of the pool on this one core and take a while to spread them out.
pub fn share_out<W: Send>(work: impl Iterator<Item = W> + Send, each: impl Fn(W) + Sync) {
    let queue = Mutex::new(work);
    let next = || queue.lock().ok().and_then(|mut queue| queue.next());
    let drain = || {
        while let Some(work) = next() {
            each(work);
        }
    };
    rayon::in_place_scope(|scope| {
        for _ in 1..rayon::current_num_threads() {
            scope.spawn(|_| drain());
        }
        drain();
    });
}
