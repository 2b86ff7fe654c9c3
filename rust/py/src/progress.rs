//! Long work on a thread of its own, while the calling thread tells Python how far it is and looks for signals.
//!
//! Only the calling thread enters Python: for signals 25 times a second, to tell the progress 8 times. When it is interrupted it returns at once; the work is told to
//! stop, and ends at its next unit without anyone waiting for it, which is why it owns its data.

use armgap_fit::progress::{Control, Observer, Progress};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Time between two looks for signals.
const LOOK: Duration = Duration::from_millis(40);

/// Looks from one telling of the progress to the next.
const TELL: u32 = 3;

/// What the two threads share.
#[derive(Default)]
struct Shared {
    latest: Mutex<Option<Progress>>,
    stop: AtomicBool,
}

/// Runs `work`, which is given an observer; `told(title, fraction)` is called with the progress. Without it, work is short: it is done on
/// this thread, and nothing interrupts it.
pub fn with_progress<T: Send + 'static>(
    py: Python<'_>,
    told: Option<&Py<PyAny>>,
    work: impl FnOnce(&Observer) -> T + Send + 'static,
) -> PyResult<T> {
    let Some(told) = told else {
        let nobody: Observer = Arc::new(|_| Control::Go);
        let ended = py.detach(move || catch_unwind(AssertUnwindSafe(|| work(&nobody))));
        return ended.map_err(defect);
    };
    let shared = Arc::new(Shared::default());
    let observer = observer(&shared);
    let (send, ended) = sync_channel(1);
    let thread = std::thread::spawn(move || {
        // Nobody listens any more after an interrupt.
        let _ = send.send(work(&observer));
    });
    let looked = Arc::clone(&shared);
    let result = py.detach(move || wait(&ended, &looked, told));
    match result {
        Ok(Some(result)) => {
            tell(py, &shared, told, true)?;
            Ok(result)
        }
        Ok(None) => match thread.join() {
            Err(panic) => Err(defect(panic)),
            Ok(()) => unreachable!("a thread that ends without a result has panicked"),
        },
        Err(error) => {
            shared.stop.store(true, Relaxed);
            Err(error)
        }
    }
}

/// A panic as an error for Python: what the work said last, and that it should not have.
#[expect(clippy::needless_pass_by_value, reason = "a panic's payload is given away")]
fn defect(panic: Box<dyn Any + Send>) -> PyErr {
    let said =
        panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    let said = said.unwrap_or("no message");
    PyRuntimeError::new_err(format!(
        "armgap failed inside ({said}); this is a defect of armgap, please report it with the arm file and the logs"
    ))
}

/// Waits for the result; none if the thread ended without.
fn wait<T>(ended: &Receiver<T>, shared: &Shared, told: &Py<PyAny>) -> PyResult<Option<T>> {
    let mut looks = 0;
    loop {
        looks += 1;
        match ended.recv_timeout(LOOK) {
            Ok(result) => return Ok(Some(result)),
            Err(RecvTimeoutError::Disconnected) => return Ok(None),
            Err(RecvTimeoutError::Timeout) => {
                let told = (looks % TELL == 1).then_some(told);
                Python::attach(|py| look(py, shared, told))?;
            }
        }
    }
}

/// Lets Python handle its signals, and tells it how far the work is if it wants to know now.
fn look(py: Python<'_>, shared: &Shared, told: Option<&Py<PyAny>>) -> PyResult<()> {
    py.check_signals()?;
    told.map_or(Ok(()), |told| tell(py, shared, told, false))
}

/// Tells Python how far the work is; all of it, once it has ended.
fn tell(py: Python<'_>, shared: &Shared, told: &Py<PyAny>, ended: bool) -> PyResult<()> {
    let latest = *shared.latest.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(progress) = latest {
        let fraction = if ended { 1.0 } else { progress.fraction };
        told.call1(py, (progress.phase.title(), fraction))?;
    }
    Ok(())
}

fn observer(shared: &Arc<Shared>) -> Observer {
    let shared = Arc::clone(shared);
    Arc::new(move |progress| {
        *shared.latest.lock().unwrap_or_else(PoisonError::into_inner) = Some(progress);
        if shared.stop.load(Relaxed) { Control::ContactGuess } else { Control::Go }
    })
}
