#ifndef PENDULA_PENDULA_H
#define PENDULA_PENDULA_H

/* pendula for C, and for every language that can call C: the same models, simulations and ensembles as in pendula.hpp,
 * which is built on these functions. Units are SI, angles in radians. A motion consists of coordinates q and their
 * rates v, pendula_coordinates() numbers each; for a chain theta_1 ... theta_n, then in space phi_1 ... phi_n.
 *
 * On failure, functions that make something return NULL, and the others a status >= PENDULA_FAILED; pendula_error()
 * says why, in words. Models are immutable and may be shared by threads; a simulation may be used by one thread at a
 * time. */

/* NOLINTBEGIN(modernize-deprecated-headers, modernize-use-using, modernize-redundant-void-arg,
   readability-identifier-naming): C */

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum pendula_status {
  PENDULA_OK = 0,
  PENDULA_EVENT = 1,       /* an event stopped the run: pendula_stopped_by() */
  PENDULA_STOPPED = 2,     /* it was asked to stop, or a callback returned nonzero */
  PENDULA_FAILED = 3,      /* the computation failed; the motion keeps its last state */
  PENDULA_INVALID = 4,     /* an argument is wrong */
  PENDULA_NO_KERNEL = 5,   /* this build lacks a kernel that is needed */
  PENDULA_NOT_WRITTEN = 6, /* a file cannot be written */
  PENDULA_INTERNAL = 7     /* anything else */
} pendula_status;

/* Why the last failed call of this thread failed; "" if none has. */
const char* pendula_error(void);
pendula_status pendula_error_kind(void);

/* "0.1.0", and the instruction set that the library uses. */
const char* pendula_version(void);
const char* pendula_instruction_set(void);

/* --- Models --- */

typedef struct pendula_model pendula_model;

/* A torque amplitude sin(frequency t + phase) on a link, counted from 0. */
typedef struct pendula_drive {
  int link;
  double amplitude[3]; /* N m; in the plane only the first is used */
  double frequency, phase;
} pendula_drive;

typedef struct pendula_chain {
  int dimension; /* 2: in a plane, 3: in space */
  int links;
  const double *masses, *lengths; /* (links) kg, m */
  double gravity;                 /* m/s^2 */
  const double* damping;          /* (links) N m s, or NULL: none */
  const double* torque;           /* N m, link by link, one number each in the plane, three in space; or NULL: none */
  const pendula_drive* drives;
  size_t drive_count;
} pendula_chain;

pendula_model* pendula_model_of_chain(const pendula_chain* chain);

/* A built-in model such as "cart_chain"; 0 links: the first one that this build has. `parameters`: (count) numbers,
 * concatenated; NULL: the defaults of the model. */
pendula_model* pendula_model_named(const char* name, int links, const double* parameters, size_t count);

/* A model of a SystemTable (pendula/system/system_table.hpp), compiled with the headers of this very version, which
 * must outlive it. `inputs` are constant; may be NULL. */
pendula_model* pendula_model_of_table(const void* table, const double* parameters, size_t parameter_count,
                                      const double* inputs, size_t input_count);

/* A model of a kernel that the program is linked with: the address of `pendula_kernel` in what
 * `python -m pendula_codegen program --as c` writes, of this very version, which must outlive it. `parameters`: (count)
 * numbers, concatenated; NULL: the defaults of the model. */
pendula_model* pendula_model_of_kernel(const void* kernel, const double* parameters, size_t count);

/* A model of a program: the text that `python -m pendula_codegen program --as bytecode` writes, which is interpreted.
 * `parameters`: (count) numbers, concatenated; NULL: the defaults of the model. */
pendula_model* pendula_model_of_program(const char* text, const double* parameters, size_t count);

/* The same model with amplitude sin(frequency t + phase) added to an input, counted from 0; `model` may be freed. The
 * drives of a chain are in pendula_chain. */
pendula_model* pendula_model_driven(const pendula_model* model, size_t input, double amplitude, double frequency,
                                    double phase);

void pendula_model_free(pendula_model* model);

/* Numbers of coordinates; of inputs, which for a chain are its torques, link by link; and of columns of a row: t,
 * coordinates, rates, inputs (not for a chain), points, energy. */
size_t pendula_coordinates(const pendula_model* model);
size_t pendula_inputs(const pendula_model* model);
size_t pendula_columns(const pendula_model* model);
/* Name of an input: "push", "torque_1", in space "torque_x_1"; valid as long as the model. NULL if out of range. */
const char* pendula_input_name(const pendula_model* model, size_t input);
/* Name and unit of a column: "theta_dot_1", "rad/s"; valid as long as the model. NULL if out of range. */
const char* pendula_column_name(const pendula_model* model, size_t column);
const char* pendula_column_unit(const pendula_model* model, size_t column);
/* Number of parameters, each number for itself: of a chain its masses, lengths and damping, link by link, then its
 * gravity; of another model those that pendula_model_named() takes, in the same order. */
size_t pendula_parameters(const pendula_model* model);
/* Name and unit of a parameter: "masses_2", "kg"; valid as long as the model. NULL if out of range. */
const char* pendula_parameter_name(const pendula_model* model, size_t parameter);
const char* pendula_parameter_unit(const pendula_model* model, size_t parameter);
/* Writes the values of the parameters, (pendula_parameters()). */
void pendula_parameter_values(const pendula_model* model, double* values);
/* Writes the numbers of one row, (pendula_columns()). Inputs are held; NULL: those of the model. */
pendula_status pendula_row(const pendula_model* model, double time, const double* q, const double* v,
                           const double* inputs, double* row);

/* Writes the kinetic and the potential energy of a motion, (2)  [J]; of a system whose energy is h = v.dL/dv - L the
 * second number is what is left of h. */
pendula_status pendula_energies(const pendula_model* model, double time, const double* q, const double* v,
                                double* energies);

/* Brings a motion onto the constraints of its model: by the least change of the coordinates whose `kept` is 0, (NULL:
 * of all), then by the change of rates that has the least kinetic energy. Where that cannot be, q and v stay as they
 * are, and pendula_error() says what is left over. */
pendula_status pendula_assemble(const pendula_model* model, double time, const int* kept, double* q, double* v);

/* --- One simulation --- */

/* Names as in scenarios; NULL: "gauss", "momentum", "auto", "auto". All zero: adaptive steps. */
typedef struct pendula_options {
  const char *method, *form, *solver, *iteration;
  int stages;       /* 0: by the tolerance; 4 for constant steps */
  double step;      /* s, constant; 0: adaptive, by the tolerance */
  double tolerance; /* 0: 1e-9 */
  int forget;       /* 1: do not keep earlier steps for pendula_at() */
} pendula_options;

typedef struct pendula_simulation pendula_simulation;

/* Starts from a motion at `time`. `options` may be NULL. */
pendula_simulation* pendula_simulation_new(const pendula_model* model, double time, const double* q, const double* v,
                                           const pendula_options* options);
/* A copy continues exactly as the original, to the last bit, with its events and without its rows. `contexts`, one for
 * each event in the order of their addition, are passed to its callbacks; NULL: those of the original. */
pendula_simulation* pendula_simulation_copy(const pendula_simulation* simulation, void* const* contexts);
void pendula_simulation_free(pendula_simulation* simulation);

/* Advances to `time`, where a step ends. */
pendula_status pendula_advance_to(pendula_simulation* simulation, double time);
/* Takes one step of its own size, which ends where it does: pendula_time(). Within this last step pendula_at() costs
 * little, and is there whether earlier steps are kept or not. */
pendula_status pendula_step(pendula_simulation* simulation);

double pendula_time(const pendula_simulation* simulation);
void pendula_motion(const pendula_simulation* simulation, double* q, double* v);
/* Writes the row of the current motion, with the inputs held. */
pendula_status pendula_simulation_row(const pendula_simulation* simulation, double* row);
/* The motion at any time since the start, at the full order of the method; if no steps are kept, from the start of a
 * last one by pendula_step(). */
pendula_status pendula_at(pendula_simulation* simulation, double time, double* q, double* v);
/* Number of steps taken. */
size_t pendula_steps(const pendula_simulation* simulation);

/* Holds all inputs, (count), constant from now on; drives are added to them. They are part of copies and of what is
 * saved. At first those of the model are held. Callbacks must not call this. */
pendula_status pendula_hold(pendula_simulation* simulation, const double* inputs, size_t count);
/* Writes the inputs held, (pendula_inputs()). */
void pendula_held(const pendula_simulation* simulation, double* inputs);

/* Continues from another motion at `time`, such as after an impact. */
pendula_status pendula_restart(pendula_simulation* simulation, double time, const double* q, const double* v);

/* Saves everything that the next steps depend on, as pendula_saved() numbers, and continues from them in a simulation
 * with the same model, options and events. */
size_t pendula_saved(pendula_simulation* simulation);
pendula_status pendula_save(pendula_simulation* simulation, double* numbers, size_t count);
pendula_status pendula_resume(pendula_simulation* simulation, const double* numbers, size_t count);

/* From now on `stop` is asked after every step, and within long ones: nonzero stops the run. NULL: none. */
pendula_status pendula_heed(pendula_simulation* simulation, int (*stop)(void* context), void* context);

typedef struct pendula_event {
  /* The event happens where this changes sign. */
  double (*value)(void* context, double time, const double* q, const double* v);
  /* Called when it happens; `up`: from - to +. Nonzero stops the run there. May be NULL. */
  int (*happened)(void* context, int up, double time, const double* q, const double* v);
  void* context;
  int direction; /* 1: up only, -1: down only, 0: both */
  int stop;      /* 1: the run stops there */
} pendula_event;

/* Watches for an event from now on; events are numbered from 0. */
pendula_status pendula_on(pendula_simulation* simulation, const pendula_event* event);
/* The event that stopped the last advance; -1: none. */
int pendula_stopped_by(const pendula_simulation* simulation);

/* Writes rows from now on every `interval`, independent of the steps: to a CSV file, or to a callback, which stops the
 * run by returning nonzero. */
pendula_status pendula_write_csv(pendula_simulation* simulation, const char* file, double interval);
pendula_status pendula_on_rows(pendula_simulation* simulation, double interval,
                               int (*row)(void* context, const double* numbers, size_t count), void* context);
/* Ends all rows and closes their files. pendula_simulation_free() does so, too, but reports no error. */
pendula_status pendula_finish(pendula_simulation* simulation);

/* dx/dt = A x + B inputs, linearised about the current motion, x the d independent coordinates and rates; row by row:
 * A is (d, d), B (d, inputs). Either may be NULL. */
pendula_status pendula_linearize(const pendula_simulation* simulation, double* a, double* b);
/* The d coordinates and rates from which the others follow by constraints: their number, and where they are in (q, v),
 * ascending, in room for 2n. Without constraints all are. */
pendula_status pendula_independent(const pendula_simulation* simulation, int* count, int* places);

/* --- Derivatives --- */

/* A motion that is differentiated exactly as its steps move it; the sizes of the steps are held. Models with functions
 * of several pieces are refused. */
typedef struct pendula_path {
  const pendula_model* model;
  double time;         /* s; start of the motion at q and v */
  const double *q, *v; /* v may be NULL: at rest */
  const double* times; /* (time_count) s, ascending from the start on; a step ends at each */
  size_t time_count;
  const double* inputs;           /* held, (pendula_inputs()); or NULL: those of the model */
  const pendula_options* options; /* or NULL; only gauss in momentum form, and radau */
  int (*stop)(void* context);     /* or NULL; asked before every step; nothing is written if it stops the run */
  void* context;
} pendula_path;

/* Writes d(q, v)/dt of a motion, (2n), while `inputs` are held, (pendula_inputs()); NULL: those of the model. */
pendula_status pendula_field(const pendula_model* model, double time, const double* q, const double* v,
                             const double* inputs, double* field);

/* Forward: writes the states (q, v) at the times, (times, 2n), and what they change by, (times, 2n, count), row by row,
 * where the start changes by `of_start`, (2n, count), and parameters, then inputs, by `of_parameters`,
 * (pendula_parameters() + pendula_inputs(), count). Inputs change by constants. Any of the four may be NULL: no change,
 * or not wanted.
 *
 * Where an event g(q, v, t) = 0 ends the motion, its time changes, too: by dt = -(g_x dx) / (g_x f + g_t), and the
 * state there by dx + f dt, with f of pendula_field(). */
pendula_status pendula_push(const pendula_path* path, const double* of_start, const double* of_parameters, size_t count,
                            double* states, double* changes);

/* Backward, the transpose: from the gradients of a number by the states at the times, (times, 2n), writes its gradients
 * by the start, (2n), and by parameters, then inputs. The results may be NULL. Steps are taken once more for it. */
pendula_status pendula_pull(const pendula_path* path, const double* gradients, double* states, double* by_start,
                            double* by_parameters);

/* --- Ensembles --- */

typedef struct pendula_ensemble {
  const pendula_model* const* models; /* one for all, or one for each */
  size_t model_count;
  const double* starts; /* (members, 2 coordinates): q and v of each, row by row */
  size_t members;
  double time, duration;          /* s; start of all members, and duration */
  const pendula_options* options; /* or NULL */
  int threads;                    /* 0: one per processor */
  int (*stop)(void* context);     /* or NULL; asked by several threads at once */
  void* context;
} pendula_ensemble;

/* Writes the end of each member, (members, 2 coordinates), and its status: PENDULA_OK, PENDULA_FAILED or
 * PENDULA_STOPPED; in the last two cases the end is the last state reached. `energy_errors`, relative, and `how` may be
 * NULL. A member that fails does not stop the others. */
pendula_status pendula_propagate(const pendula_ensemble* ensemble, double* ends, pendula_status* how,
                                 double* energy_errors);

/* --- Lyapunov exponents --- */

typedef struct pendula_tangents {
  const pendula_model* model;
  double time;                    /* s; start of the motion at q and v */
  const double *q, *v;            /* v may be NULL: at rest */
  double duration;                /* s */
  const pendula_options* options; /* or NULL; only gauss in momentum form, and radau */
  size_t count;                   /* of leading exponents, at most 2 pendula_coordinates() */
  int (*stop)(void* context);     /* or NULL; asked after every step */
  void* context;
} pendula_tangents;

typedef struct pendula_spectrum {
  double sum;      /* 1/s, of the exponents; for all of them the mean divergence */
  double duration; /* s, of the run */
  double ftle;     /* 1/s, finite-time exponent of one tangent */
  double megno;    /* 2 for regular motion, exponent * duration / 2 in chaos */
} pendula_spectrum;

/* Writes the leading exponents of a motion, (count) in descending order, 1/s, and the error of each, infinite if the
 * run was too short to tell. `errors` and `rest` may be NULL. If stopped, the results are those of the time until then.
 */
pendula_status pendula_lyapunov(const pendula_tangents* tangents, double* exponents, double* errors,
                                pendula_spectrum* rest);

#ifdef __cplusplus
}
#endif

/* NOLINTEND(modernize-deprecated-headers, modernize-use-using, modernize-redundant-void-arg,
   readability-identifier-naming) */

#endif
