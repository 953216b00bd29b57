#ifndef PENDULA_PENDULA_H
#define PENDULA_PENDULA_H

/* pendula for C, and for every language that can call C: the same models, simulations and ensembles as in pendula.hpp,
 * which stands on these functions. Units are SI, angles radians. A motion is its coordinates q and their rates v, each
 * pendula_coordinates() numbers; of a chain theta_1 ... theta_n, then in space phi_1 ... phi_n.
 *
 * Functions that make something give NULL where they fail, the others a status that is not PENDULA_OK; pendula_error()
 * says why, in words. Models never change and may be shared by threads; a simulation is one thread's at a time. */

/* NOLINTBEGIN(modernize-deprecated-headers, modernize-use-using, modernize-redundant-void-arg,
   readability-identifier-naming): C */

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum pendula_status {
  PENDULA_OK = 0,
  PENDULA_EVENT = 1,       /* an event that stops the run has happened: pendula_stopped_by() */
  PENDULA_STOPPED = 2,     /* it was asked to stop, or a callback gave something other than 0 */
  PENDULA_FAILED = 3,      /* the computation failed; the motion stays where it came to */
  PENDULA_INVALID = 4,     /* an argument is wrong */
  PENDULA_NO_KERNEL = 5,   /* this build lacks a kernel that is needed */
  PENDULA_NOT_WRITTEN = 6, /* a file cannot be written */
  PENDULA_INTERNAL = 7     /* anything else */
} pendula_status;

/* Why the last call of this thread that failed did so; "" where none has. */
const char* pendula_error(void);
pendula_status pendula_error_kind(void);

/* "0.1.0", and the instruction set that the library runs by. */
const char* pendula_version(void);
const char* pendula_instruction_set(void);

/* --- What moves: a model with its numbers --- */

typedef struct pendula_model pendula_model;

/* A torque amplitude sin(frequency t + phase) on one link, counted from 0. */
typedef struct pendula_drive {
  int link;
  double amplitude[3]; /* N m; in the plane the first one counts */
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

/* A built-in model ("cart_chain", 0 links: the first that this build has), by its parameters, (count) numbers one after
 * the other; NULL: those that the model has itself. */
pendula_model* pendula_model_named(const char* name, int links, const double* parameters, size_t count);

/* Of a SystemTable (pendula/system/system_table.hpp), which has to outlive it. `inputs` are constant ones, or NULL. */
pendula_model* pendula_model_of_table(const void* table, const double* parameters, size_t parameter_count,
                                      const double* inputs, size_t input_count);

void pendula_model_free(pendula_model* model);

/* Coordinates; inputs, which of a chain are its torques, link by link; and columns of a row: t, coordinates, rates,
 * inputs of a model that is no chain, points, energy. */
size_t pendula_coordinates(const pendula_model* model);
size_t pendula_inputs(const pendula_model* model);
size_t pendula_columns(const pendula_model* model);
/* Of an input, "push", "torque_1", in space "torque_x_1"; it lives as long as the model. NULL where there is none. */
const char* pendula_input_name(const pendula_model* model, size_t input);
/* Of a column, "theta_dot_1", "rad/s"; they live as long as the model. NULL where there is none of that number. */
const char* pendula_column_name(const pendula_model* model, size_t column);
const char* pendula_column_unit(const pendula_model* model, size_t column);
/* The numbers of one row. */
pendula_status pendula_row(const pendula_model* model, double time, const double* q, const double* v, double* row);

/* --- One simulation --- */

/* Names are those of scenarios, NULL: "gauss", "momentum", "auto", "auto". All zero: steps of its own choice. */
typedef struct pendula_options {
  const char *method, *form, *solver, *iteration;
  int stages;       /* 0: as many as serve */
  double step;      /* s, of constant steps; 0: of its own choice, by the tolerance */
  double tolerance; /* 0: 1e-9 */
  int forget;       /* 1: earlier steps are not kept for pendula_at() */
} pendula_options;

typedef struct pendula_simulation pendula_simulation;

/* From a motion at `time`. `options` may be NULL. */
pendula_simulation* pendula_simulation_new(const pendula_model* model, double time, const double* q, const double* v,
                                           const pendula_options* options);
/* One that goes on as the first does, to the bit, with its events and without its rows. `contexts`, one for each event
 * in the order that they were added, go to its callbacks; NULL: those of the first. */
pendula_simulation* pendula_simulation_copy(const pendula_simulation* simulation, void* const* contexts);
void pendula_simulation_free(pendula_simulation* simulation);

/* Goes on to `time`, where a step ends. */
pendula_status pendula_advance_to(pendula_simulation* simulation, double time);

double pendula_time(const pendula_simulation* simulation);
void pendula_motion(const pendula_simulation* simulation, double* q, double* v);
/* The numbers of the row where it is, with the inputs that are held. */
pendula_status pendula_simulation_row(const pendula_simulation* simulation, double* row);
/* The motion at any time since the start, at the full order of the method. */
pendula_status pendula_at(pendula_simulation* simulation, double time, double* q, double* v);
/* Steps that were taken. */
size_t pendula_steps(const pendula_simulation* simulation);

/* Holds inputs, (count) of them, from now on until others are held; drives are added to them. They are part of copies
 * and of what is saved. At first those of the model are held. Not from within an advance, by a callback. */
pendula_status pendula_hold(pendula_simulation* simulation, const double* inputs, size_t count);
/* Those that are held, (pendula_inputs()). */
void pendula_held(const pendula_simulation* simulation, double* inputs);

/* Goes on from another motion, at the time of that: after an impact, say. */
pendula_status pendula_restart(pendula_simulation* simulation, double time, const double* q, const double* v);

/* All that its next steps depend on: numbers, of which there are pendula_saved(), to go on from in a simulation of the
 * same model, options and events. */
size_t pendula_saved(pendula_simulation* simulation);
pendula_status pendula_save(pendula_simulation* simulation, double* numbers, size_t count);
pendula_status pendula_resume(pendula_simulation* simulation, const double* numbers, size_t count);

/* Asked from now on after every step, and within long ones: other than 0, the run stops there. NULL: no more. */
pendula_status pendula_heed(pendula_simulation* simulation, int (*stop)(void* context), void* context);

typedef struct pendula_event {
  /* What changes its sign where it happens. */
  double (*value)(void* context, double time, const double* q, const double* v);
  /* Told when it does, `up` or down; other than 0: the run stops there. May be NULL. */
  int (*happened)(void* context, int up, double time, const double* q, const double* v);
  void* context;
  int direction; /* 1: up alone, -1: down alone, 0: both */
  int stop;      /* 1: the run stops there */
} pendula_event;

/* Looks for it from now on; events are numbered from 0. */
pendula_status pendula_on(pendula_simulation* simulation, const pendula_event* event);
/* The event that stopped the run last; -1: none has. */
int pendula_stopped_by(const pendula_simulation* simulation);

/* Rows from now on every `interval`, whatever the steps are: to a CSV file, or to a callback, which may stop the run by
 * giving something other than 0. */
pendula_status pendula_write_csv(pendula_simulation* simulation, const char* file, double interval);
pendula_status pendula_on_rows(pendula_simulation* simulation, double interval,
                               int (*row)(void* context, const double* numbers, size_t count), void* context);
/* Files are written and closed, which pendula_simulation_free() does as well, without a word. */
pendula_status pendula_finish(pendula_simulation* simulation);

/* Where it is, d(q, v)/dt = A (q, v) + B inputs beside the motion, row by row: A is (2n, 2n), B (2n, inputs). Either
 * may be NULL. */
pendula_status pendula_linearize(const pendula_simulation* simulation, double* a, double* b);

/* --- Many at once --- */

typedef struct pendula_ensemble {
  const pendula_model* const* models; /* one for all, or one for each */
  size_t model_count;
  const double* starts; /* (members, 2 coordinates): q and v of each, row by row */
  size_t members;
  double time, duration;          /* s; where all begin, and how long */
  const pendula_options* options; /* or NULL */
  int threads;                    /* 0: as many as there are processors */
  int (*stop)(void* context);     /* or NULL; asked by several threads at once */
  void* context;
} pendula_ensemble;

/* Where each ends, (members, 2 coordinates), and how: PENDULA_OK, PENDULA_FAILED or PENDULA_STOPPED, whose end is where
 * it came to. `energy_errors`, relative, and `how` may be NULL. Who fails stops nobody else. */
pendula_status pendula_propagate(const pendula_ensemble* ensemble, double* ends, pendula_status* how,
                                 double* energy_errors);

/* --- Lyapunov exponents --- */

typedef struct pendula_tangents {
  const pendula_model* model;
  double time;                    /* s; where the motion starts, from q and v */
  const double *q, *v;            /* v may be NULL: at rest */
  double duration;                /* s */
  const pendula_options* options; /* or NULL; methods with derivatives alone: gauss in momentum form, radau */
  size_t count;                   /* how many of the leading exponents, at most 2 pendula_coordinates() */
  int (*stop)(void* context);     /* or NULL; asked after every step */
  void* context;
} pendula_tangents;

typedef struct pendula_spectrum {
  double sum;      /* 1/s, of the exponents; of all of them the mean divergence */
  double duration; /* s, that was run */
  double ftle;     /* 1/s, finite-time exponent of one tangent */
  double megno;    /* 2 where motion is regular, exponent * duration / 2 in chaos */
} pendula_spectrum;

/* The leading exponents of a motion, (count) in descending order, 1/s, and the error of each, infinite where the run
 * was too short to tell. `errors` and `rest` may be NULL. Where it was stopped they are those of the time until then.
 */
pendula_status pendula_lyapunov(const pendula_tangents* tangents, double* exponents, double* errors,
                                pendula_spectrum* rest);

#ifdef __cplusplus
}
#endif

/* NOLINTEND(modernize-deprecated-headers, modernize-use-using, modernize-redundant-void-arg,
   readability-identifier-naming) */

#endif
