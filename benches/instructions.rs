//! One kernel a given number of times, for an instruction counter: `instructions "P3P" 200`; `instructions list` names
//! them; without arguments every kernel runs once and must not allocate.
#![allow(unsafe_code)]
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

mod workload;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

struct Counting;

// SAFETY: hands every request to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `GlobalAlloc::alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the pointer came from `System.alloc` with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

struct List;

impl workload::Measure for List {
    fn measure(&mut self, name: &str, _: &mut dyn FnMut()) {
        println!("{name}");
    }
}

struct Repeated<'a> {
    wanted: &'a str,
    calls: usize,
}

impl workload::Measure for Repeated<'_> {
    fn measure(&mut self, name: &str, call: &mut dyn FnMut()) {
        if name == self.wanted {
            for _ in 0..self.calls {
                call();
            }
        }
    }
}

struct WithoutHeap;

impl workload::Measure for WithoutHeap {
    fn measure(&mut self, name: &str, call: &mut dyn FnMut()) {
        let before = ALLOCATIONS.load(Ordering::Relaxed);
        call();
        let after = ALLOCATIONS.load(Ordering::Relaxed);
        assert_eq!(before, after, "{name} allocates");
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    match arguments.as_slice() {
        [] => workload::visit(&mut WithoutHeap),
        [list] if list == "list" => workload::visit(&mut List),
        [wanted, calls] => match calls.parse() {
            Ok(calls) => workload::visit(&mut Repeated { wanted, calls }),
            Err(_) => eprintln!("{calls} is no number of calls"),
        },
        _ => eprintln!("instructions [list | KERNEL CALLS]"),
    }
}
