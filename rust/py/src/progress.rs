//! Progress callbacks: long work runs on a thread of its own, while the calling thread reports progress to Python and checks for signals.
//!
//! Only the calling thread enters Python: for signals 25 times a second, to report progress 8 times. When interrupted, the calling thread returns at
//! once; the work is cancelled, and ends at its next unit while no thread waits for it, which is why the work owns its data.

use armgap_fit::progress::{Control, Observer, Progress};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Time between two checks for Python signals during long work.
const CHECK: Duration = Duration::from_millis(40);

/// Number of signal checks from one progress report to the next.
const CHECKS_PER_REPORT: u32 = 3;

/// Latest progress, and whether to stop, shared by the calling and the working thread.
#[derive(Default)]
struct Shared {
    latest: Mutex<Option<Progress>>,
    stop: AtomicBool,
}

/// Runs `work` on its own thread and calls `callback(title, fraction)` with its progress. Without a callback, work is short: it runs on the calling
/// thread without interruption.
pub fn with_progress<T: Send + 'static>(
    py: Python<'_>,
    callback: Option<&Py<PyAny>>,
    work: impl FnOnce(&Observer) -> T + Send + 'static,
) -> PyResult<T> {
    let Some(callback) = callback else {
        let nobody: Observer = Arc::new(|_| Control::Go);
        return py.detach(move || guarded_from_panics(|| work(&nobody)));
    };
    let shared = Arc::new(Shared::default());
    let observer = observer(&shared);
    let (send, ended) = sync_channel(1);
    let thread = std::thread::spawn(move || {
        // After an interrupt nothing receives the result.
        let _ = send.send(work(&observer));
    });
    let looked = Arc::clone(&shared);
    let result = py.detach(move || wait(&ended, &looked, callback));
    match result {
        Ok(Some(result)) => {
            report(py, &shared, callback, true)?;
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

/// Runs `work` and returns its result; a panic is a Python error.
pub fn guarded_from_panics<T>(work: impl FnOnce() -> T) -> PyResult<T> {
    catch_unwind(AssertUnwindSafe(work)).map_err(defect)
}

/// Panic as a Python error, with the panic's message and a request to report it.
#[expect(clippy::needless_pass_by_value, reason = "a panic's payload is given away")]
fn defect(panic: Box<dyn Any + Send>) -> PyErr {
    let said =
        panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    let said = said.unwrap_or("no message");
    PyRuntimeError::new_err(format!(
        "armgap failed inside ({said}); this is a defect of armgap, please report it with the arm file and the logs"
    ))
}

/// Waits for the result of the work, with checks for signals and progress reports; `None` if its thread ended without a result.
fn wait<T>(ended: &Receiver<T>, shared: &Shared, callback: &Py<PyAny>) -> PyResult<Option<T>> {
    let mut checks = 0;
    loop {
        checks += 1;
        match ended.recv_timeout(CHECK) {
            Ok(result) => return Ok(Some(result)),
            Err(RecvTimeoutError::Disconnected) => return Ok(None),
            Err(RecvTimeoutError::Timeout) => {
                let callback = (checks % CHECKS_PER_REPORT == 1).then_some(callback);
                Python::attach(|py| poll(py, shared, callback))?;
            }
        }
    }
}

/// Lets Python handle its signals, and reports the progress if a callback is given.
fn poll(py: Python<'_>, shared: &Shared, callback: Option<&Py<PyAny>>) -> PyResult<()> {
    py.check_signals()?;
    callback.map_or(Ok(()), |callback| report(py, shared, callback, false))
}

/// Calls the callback with the latest progress, with the fraction 1 once the work has ended.
fn report(py: Python<'_>, shared: &Shared, callback: &Py<PyAny>, ended: bool) -> PyResult<()> {
    let latest = *shared.latest.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(progress) = latest {
        let fraction = if ended { 1.0 } else { progress.fraction };
        callback.call1(py, (progress.phase.title(), fraction))?;
    }
    Ok(())
}

fn observer(shared: &Arc<Shared>) -> Observer {
    let shared = Arc::clone(shared);
    Arc::new(move |progress| {
        *shared.latest.lock().unwrap_or_else(PoisonError::into_inner) = Some(progress);
        if shared.stop.load(Relaxed) { Control::Stop } else { Control::Go }
    })
}
