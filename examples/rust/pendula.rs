//! A small safe wrapper of pendula.h: models, simulations, inputs and events.

use std::error;
use std::ffi::{c_char, c_int, c_void, CStr, CString};
use std::fmt;
use std::ptr::{self, NonNull};

mod c {
    use super::*;

    #[repr(C)]
    pub struct Model {
        _private: [u8; 0],
    }
    #[repr(C)]
    pub struct Simulation {
        _private: [u8; 0],
    }

    /// Names may be null.
    #[repr(C)]
    pub struct Options {
        pub method: *const c_char,
        pub form: *const c_char,
        pub solver: *const c_char,
        pub iteration: *const c_char,
        pub stages: c_int,
        pub step: f64,
        pub tolerance: f64,
        pub forget: c_int,
    }

    pub type Value = extern "C" fn(*mut c_void, f64, *const f64, *const f64) -> f64;
    pub type Happened = extern "C" fn(*mut c_void, c_int, f64, *const f64, *const f64) -> c_int;

    #[repr(C)]
    pub struct Event {
        pub value: Value,
        pub happened: Option<Happened>,
        pub context: *mut c_void,
        pub direction: c_int,
        pub stop: c_int,
    }

    #[link(name = "pendula")]
    extern "C" {
        pub fn pendula_error() -> *const c_char;
        pub fn pendula_model_of_program(
            text: *const c_char,
            parameters: *const f64,
            count: usize,
        ) -> *mut Model;
        pub fn pendula_model_free(model: *mut Model);
        pub fn pendula_coordinates(model: *const Model) -> usize;
        pub fn pendula_columns(model: *const Model) -> usize;
        pub fn pendula_column_name(model: *const Model, column: usize) -> *const c_char;
        pub fn pendula_column_unit(model: *const Model, column: usize) -> *const c_char;
        pub fn pendula_simulation_new(
            model: *const Model,
            time: f64,
            q: *const f64,
            v: *const f64,
            options: *const Options,
        ) -> *mut Simulation;
        pub fn pendula_simulation_free(simulation: *mut Simulation);
        pub fn pendula_advance_to(simulation: *mut Simulation, time: f64) -> c_int;
        pub fn pendula_motion(simulation: *const Simulation, q: *mut f64, v: *mut f64);
        pub fn pendula_simulation_row(simulation: *const Simulation, row: *mut f64) -> c_int;
        pub fn pendula_hold(simulation: *mut Simulation, inputs: *const f64, count: usize)
            -> c_int;
        pub fn pendula_on(simulation: *mut Simulation, event: *const Event) -> c_int;
    }
}

/// What pendula says of a call that failed.
pub struct Error(String);

impl fmt::Display for Error {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        out.write_str(&self.0)
    }
}
// What main() prints.
impl fmt::Debug for Error {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        out.write_str(&self.0)
    }
}
impl error::Error for Error {}

impl Error {
    fn last() -> Self {
        Error(words(unsafe { c::pendula_error() }))
    }
}

/// A copy of a text that is not null.
fn words(text: *const c_char) -> String {
    unsafe { CStr::from_ptr(text) }
        .to_string_lossy()
        .into_owned()
}

const FAILED: c_int = 3;

fn require(status: c_int) -> Result<c_int, Error> {
    if status < FAILED {
        Ok(status)
    } else {
        Err(Error::last())
    }
}

/// A mechanical system with its parameters.
pub struct Model(NonNull<c::Model>);

// Models are immutable.
unsafe impl Send for Model {}
unsafe impl Sync for Model {}

impl Model {
    /// Of the text that `python -m pendula_codegen program --as bytecode` writes, with the defaults of its parameters.
    pub fn of_program(text: &str) -> Result<Self, Error> {
        let text = CString::new(text).map_err(|error| Error(error.to_string()))?;
        let model = unsafe { c::pendula_model_of_program(text.as_ptr(), ptr::null(), 0) };
        NonNull::new(model).map(Model).ok_or_else(Error::last)
    }

    pub fn coordinates(&self) -> usize {
        unsafe { c::pendula_coordinates(self.0.as_ptr()) }
    }

    /// Name and unit of each column of a row.
    pub fn columns(&self) -> Vec<(String, String)> {
        let model = self.0.as_ptr();
        (0..unsafe { c::pendula_columns(model) })
            .map(|k| unsafe {
                (
                    words(c::pendula_column_name(model, k)),
                    words(c::pendula_column_unit(model, k)),
                )
            })
            .collect()
    }
}

impl Drop for Model {
    fn drop(&mut self) {
        unsafe { c::pendula_model_free(self.0.as_ptr()) }
    }
}

/// A function of time, coordinates and rates.
type Value<'a> = Box<dyn FnMut(f64, &[f64], &[f64]) -> f64 + 'a>;
type Happened<'a> = Box<dyn FnMut(f64, &[f64], &[f64]) + 'a>;

struct Watched<'a> {
    value: Value<'a>,
    happened: Happened<'a>,
    coordinates: usize,
}

/// A motion that goes on as far as it is asked to, within a tolerance.
pub struct Simulation<'a> {
    simulation: NonNull<c::Simulation>,
    coordinates: usize,
    columns: usize,
    events: Vec<Box<Watched<'a>>>, // which pendula points to
}

impl<'a> Simulation<'a> {
    /// From coordinates `q` and rates `v` at the time 0.
    pub fn new(model: &Model, q: &[f64], v: &[f64], tolerance: f64) -> Result<Self, Error> {
        let coordinates = model.coordinates();
        if q.len() != coordinates || v.len() != coordinates {
            return Err(Error(format!(
                "q, v: expected {coordinates} numbers, got {} and {}",
                q.len(),
                v.len()
            )));
        }
        let auto = ptr::null();
        let options = c::Options {
            method: auto,
            form: auto,
            solver: auto,
            iteration: auto,
            stages: 0,
            step: 0.0,
            tolerance,
            forget: 1,
        };
        let made = unsafe {
            c::pendula_simulation_new(model.0.as_ptr(), 0.0, q.as_ptr(), v.as_ptr(), &options)
        };
        let simulation = NonNull::new(made).ok_or_else(Error::last)?;
        let columns = model.columns().len();
        Ok(Simulation {
            simulation,
            coordinates,
            columns,
            events: Vec::new(),
        })
    }

    /// Calls `happened` where `value` changes its sign.
    pub fn on(
        &mut self,
        value: impl FnMut(f64, &[f64], &[f64]) -> f64 + 'a,
        happened: impl FnMut(f64, &[f64], &[f64]) + 'a,
    ) -> Result<(), Error> {
        let coordinates = self.coordinates;
        let mut watched = Box::new(Watched {
            value: Box::new(value),
            happened: Box::new(happened),
            coordinates,
        });
        let context = (watched.as_mut() as *mut Watched).cast();
        let event = c::Event {
            value: value_of,
            happened: Some(tell),
            context,
            direction: 0,
            stop: 0,
        };
        self.events.push(watched);
        require(unsafe { c::pendula_on(self.simulation.as_ptr(), &event) })?;
        Ok(())
    }

    /// Holds all inputs from now on.
    pub fn hold(&mut self, inputs: &[f64]) -> Result<(), Error> {
        require(unsafe {
            c::pendula_hold(self.simulation.as_ptr(), inputs.as_ptr(), inputs.len())
        })?;
        Ok(())
    }

    pub fn advance_to(&mut self, time: f64) -> Result<(), Error> {
        require(unsafe { c::pendula_advance_to(self.simulation.as_ptr(), time) })?;
        Ok(())
    }

    /// Coordinates and rates.
    pub fn motion(&self) -> (Vec<f64>, Vec<f64>) {
        let (mut q, mut v) = (vec![0.0; self.coordinates], vec![0.0; self.coordinates]);
        unsafe { c::pendula_motion(self.simulation.as_ptr(), q.as_mut_ptr(), v.as_mut_ptr()) };
        (q, v)
    }

    /// The numbers of the columns of its model.
    pub fn row(&self) -> Result<Vec<f64>, Error> {
        let mut row = vec![0.0; self.columns];
        require(unsafe { c::pendula_simulation_row(self.simulation.as_ptr(), row.as_mut_ptr()) })?;
        Ok(row)
    }
}

impl Drop for Simulation<'_> {
    fn drop(&mut self) {
        unsafe { c::pendula_simulation_free(self.simulation.as_ptr()) }
    }
}

// A panic in a function that C calls ends the program, which Rust sees to.
extern "C" fn value_of(context: *mut c_void, time: f64, q: *const f64, v: *const f64) -> f64 {
    let watched = unsafe { &mut *context.cast::<Watched>() };
    let (q, v) = slices(q, v, watched.coordinates);
    (watched.value)(time, q, v)
}

extern "C" fn tell(
    context: *mut c_void,
    _up: c_int,
    time: f64,
    q: *const f64,
    v: *const f64,
) -> c_int {
    let watched = unsafe { &mut *context.cast::<Watched>() };
    let (q, v) = slices(q, v, watched.coordinates);
    (watched.happened)(time, q, v);
    0
}

// Numbers that C hands over.
fn slices<'q>(q: *const f64, v: *const f64, count: usize) -> (&'q [f64], &'q [f64]) {
    unsafe {
        (
            std::slice::from_raw_parts(q, count),
            std::slice::from_raw_parts(v, count),
        )
    }
}
