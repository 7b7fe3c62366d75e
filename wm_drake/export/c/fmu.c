/* Functions of an FMU of a washing machine, for FMI 2.0 (FMI_VERSION 2) and FMI 3.0 (3).

All numbers of an instance are in one array; a value reference is an index in it. The machine itself
is in wm_evaluate and wm_step, machine code of the compiled engine; machine.h has the numbers of one
machine. There are no variables outside of an instance. */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "machine.h"

#if FMI_VERSION == 2
#include "fmi2Functions.h"
#define FMI(name) fmi2##name
typedef fmi2Component Handle;
typedef fmi2FMUstate Saved;
typedef fmi2Boolean Truth;
#else
#include "fmi3Functions.h"
#define FMI(name) fmi3##name
typedef fmi3Instance Handle;
typedef fmi3FMUState Saved;
typedef fmi3Boolean Truth;
#endif
typedef FMI(Status) Status;
typedef FMI(ValueReference) Reference;
typedef FMI(String) Text;

enum { LONGEST_MESSAGE = 300, LONGEST_NAME = 100 };

/* What save and restore copy. */
typedef struct {
    char token[sizeof WM_TOKEN];
    bool has_stepped;
    double speed_time; /* when the speed input was set */
    double v[WM_SIZE];
} State;

typedef struct {
#if FMI_VERSION == 2
    const fmi2CallbackFunctions *callbacks;
#else
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
#endif
    char name[LONGEST_NAME];
    bool exchange; /* model exchange, not co-simulation */
    bool stale;    /* rates and outputs are those of other numbers */
    State state;
} Machine;

/* Compiled functions: place of a result, place of an exception, then the arguments. */
int wm_evaluate(void *result, void *error, double *v, const double *c, int64_t mode);
int wm_step(void *result, void *error, double *v, const double *c, double h, int64_t n);
#if WM_FAST
int wm_evaluate_fast(void *result, void *error, double *v, const double *c, int64_t mode);
int wm_step_fast(void *result, void *error, double *v, const double *c, double h, int64_t n);
static bool is_fast(void) {
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
}
#endif

static Status fail(Machine *m, const char *message) {
#if FMI_VERSION == 2
    const fmi2CallbackFunctions *to = m->callbacks;
    if (to && to->logger)
        to->logger(to->componentEnvironment, m->name, fmi2Error, "logStatusError", message);
#else
    if (m->log) m->log(m->environment, fmi3Error, "logStatusError", message);
#endif
    return FMI(Error);
}

static void evaluate(Machine *m) {
    void *result, *error;
    double *v = m->state.v, speed = v[WM_SPEED];
    if (WM_FOLLOWS_SPEED) {
        if (!m->exchange && !m->state.has_stepped) v[WM_IN_FORCE] = v[WM_ACCELERATION];
        /* importers may set inputs less often than they ask for rates */
        if (m->exchange) v[WM_SPEED] += v[WM_ACCELERATION] * (v[0] - m->state.speed_time);
    }
#if WM_FAST
    if (is_fast())
        wm_evaluate_fast(&result, &error, v, wm_constants, m->exchange);
    else
#endif
        wm_evaluate(&result, &error, v, wm_constants, m->exchange);
    v[WM_SPEED] = speed;
    m->stale = false;
}

static void advance(double *v, double h, int64_t n) {
    void *result, *error;
#if WM_FAST
    if (is_fast())
        wm_step_fast(&result, &error, v, wm_constants, h, n);
    else
#endif
        wm_step(&result, &error, v, wm_constants, h, n);
}

static void reset(Machine *m) {
    memcpy(m->state.token, WM_TOKEN, sizeof WM_TOKEN);
    memcpy(m->state.v, wm_start, sizeof wm_start);
    m->state.has_stepped = false;
    m->state.speed_time = 0.0;
    m->stale = true;
}

static Machine *create(const char *name, bool exchange) {
    Machine *m = calloc(1, sizeof *m);
    if (!m) return NULL;
    snprintf(m->name, sizeof m->name, "%s", name ? name : "");
    m->exchange = exchange;
    reset(m);
    return m;
}

static Status get(Machine *m, const Reference r[], size_t n, double values[]) {
    for (size_t k = 0; k < n; k++) {
        if (r[k] >= WM_SIZE || !(wm_access[r[k]] & 1)) return fail(m, "unknown value reference");
        if (m->stale && !(wm_access[r[k]] & 2)) evaluate(m);
        values[k] = m->state.v[r[k]];
    }
    return FMI(OK);
}

static Status set(Machine *m, const Reference r[], size_t n, const double values[]) {
    char message[LONGEST_MESSAGE];
    for (size_t k = 0; k < n; k++) {
        if (r[k] >= WM_SIZE || !(wm_access[r[k]] & 2))
            return fail(m, "this variable cannot be set; inputs and parameters can");
        bool good = isfinite(values[k]);
        size_t i = 0;
        while (i < WM_LIMITS && wm_limits[i].index != r[k]) i++;
        if (i < WM_LIMITS) good = good && values[k] >= wm_limits[i].least && values[k] <= wm_limits[i].most;
        if (!good) {
            snprintf(message, sizeof message, "%s = %g is out of range; allowed are %g to %g",
                     i < WM_LIMITS ? wm_limits[i].name : "an input", values[k],
                     i < WM_LIMITS ? wm_limits[i].least : -HUGE_VAL,
                     i < WM_LIMITS ? wm_limits[i].most : HUGE_VAL);
            return fail(m, message);
        }
        m->state.v[r[k]] = values[k];
        if (r[k] == WM_SPEED) m->state.speed_time = m->state.v[0];
    }
    if (n) m->stale = true;
    return FMI(OK);
}

/* At the end of the initialization the drum has the speed of its input. */
static Status begin(Machine *m) {
    if (WM_FOLLOWS_SPEED) m->state.v[WM_STATE + WM_DRUM_RATE] = m->state.v[WM_SPEED];
    m->state.speed_time = m->state.v[0];
    m->stale = true;
    return FMI(OK);
}

static Status diverged(Machine *m) {
    static const char *const names[] = {"roll", "pitch", "yaw", "x", "y", "z"};
    char message[LONGEST_MESSAGE];
    for (int k = 0; k < 6; k++) {
        double value = m->state.v[WM_STATE + k], bound = k < 3 ? WM_LARGEST_ANGLE : WM_LARGEST_SHIFT;
        if (fabs(value) <= bound) continue;
        snprintf(message, sizeof message, "the run diverged at %.3f s: %s of the tub = %.4g %s, bound %g %s",
                 m->state.v[0], names[k], value, k < 3 ? "rad" : "m", bound, k < 3 ? "rad" : "m");
        return fail(m, message);
    }
    for (int k = WM_CABINET; WM_CABINET && k < WM_CABINET + 2; k++)
        if (!(fabs(m->state.v[k]) <= WM_LARGEST_TILT)) return fail(m, "the cabinet tips over");
    return FMI(OK);
}

static Status do_step(Machine *m, double time, double length) {
    double steps = ceil(length / WM_STEP * (1.0 - 1e-9));
    if (!(length > 0.0) || !isfinite(time + length))
        return fail(m, "the length of a communication step must be above zero");
    int64_t n = steps < 1.0 ? 1 : (int64_t)steps;
    advance(m->state.v, length / (double)n, n);
    m->state.v[0] = time + length;
    m->state.has_stepped = true;
    m->stale = true;
    return diverged(m);
}

static Status save(Machine *m, Saved *saved) {
    if (!*saved) *saved = malloc(sizeof(State));
    if (!*saved) return fail(m, "out of memory");
    memcpy(*saved, &m->state, sizeof(State));
    return FMI(OK);
}

static Status restore(Machine *m, const void *saved) {
    if (!saved || memcmp(saved, WM_TOKEN, sizeof WM_TOKEN)) return fail(m, "this state is of another FMU");
    memcpy(&m->state, saved, sizeof(State));
    m->stale = true;
    return FMI(OK);
}

static Status write_bytes(Machine *m, Saved saved, void *bytes, size_t size) {
    if (size < sizeof(State)) return fail(m, "too little room for the state");
    memcpy(bytes, saved, sizeof(State));
    return FMI(OK);
}

static Status read_bytes(Machine *m, const void *bytes, size_t size, Saved *saved) {
    if (size < sizeof(State) || memcmp(bytes, WM_TOKEN, sizeof WM_TOKEN))
        return fail(m, "these bytes are no state of this FMU");
    if (!*saved) *saved = malloc(sizeof(State));
    if (!*saved) return fail(m, "out of memory");
    memcpy(*saved, bytes, sizeof(State));
    return FMI(OK);
}

static Status get_states(Machine *m, double x[], size_t n) {
    for (size_t k = 0; k < n && k < WM_STATES; k++) x[k] = m->state.v[wm_states[k]];
    return n == WM_STATES ? FMI(OK) : fail(m, "wrong number of continuous states");
}

static Status set_states(Machine *m, const double x[], size_t n) {
    if (n != WM_STATES) return fail(m, "wrong number of continuous states");
    for (size_t k = 0; k < n; k++) m->state.v[wm_states[k]] = x[k];
    m->stale = true;
    return FMI(OK);
}

static Status get_rates(Machine *m, double dx[], size_t n) {
    if (n != WM_STATES) return fail(m, "wrong number of continuous states");
    if (m->stale) evaluate(m);
    for (size_t k = 0; k < n; k++) dx[k] = m->state.v[wm_states[k] - WM_STATE + WM_RATE];
    return diverged(m);
}

static Status get_nominals(double x[], size_t n) {
    for (size_t k = 0; k < n && k < WM_STATES; k++) x[k] = wm_nominals[k];
    return FMI(OK);
}

static Status set_time(Machine *m, double time) {
    m->state.v[0] = time;
    m->stale = true;
    return FMI(OK);
}

/* Functions that both versions of the standard have alike. */

Status FMI(SetDebugLogging)(Handle i, Truth on, size_t n, const Text c[]) { (void)i, (void)on, (void)n, (void)c; return FMI(OK); }
Status FMI(ExitInitializationMode)(Handle i) { return begin(i); }
Status FMI(Terminate)(Handle i) { (void)i; return FMI(OK); }
Status FMI(Reset)(Handle i) { reset(i); return FMI(OK); }
Status FMI(EnterEventMode)(Handle i) { (void)i; return FMI(OK); }
Status FMI(EnterContinuousTimeMode)(Handle i) { (void)i; return FMI(OK); }
Status FMI(SetContinuousStates)(Handle i, const double x[], size_t n) { return set_states(i, x, n); }
Status FMI(GetContinuousStates)(Handle i, double x[], size_t n) { return get_states(i, x, n); }
Status FMI(GetNominalsOfContinuousStates)(Handle i, double x[], size_t n) { (void)i; return get_nominals(x, n); }
Status FMI(GetEventIndicators)(Handle i, double z[], size_t n) { (void)i, (void)z, (void)n; return FMI(OK); }
Status FMI(SetTime)(Handle i, double time) { return set_time(i, time); }
Status FMI(CompletedIntegratorStep)(Handle i, Truth keep, Truth *event, Truth *end) { (void)i, (void)keep; *event = *end = 0; return FMI(OK); }
void FMI(FreeInstance)(Handle i) { free(i); }

#if FMI_VERSION == 2

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(Text name, fmi2Type type, Text guid, Text resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    (void)resources, (void)visible, (void)logging;
    Machine *m = create(name, type == fmi2ModelExchange);
    if (!m) return NULL;
    m->callbacks = callbacks;
    if (guid && !strcmp(guid, WM_TOKEN)) return m;
    fail(m, "the GUID is not that of this FMU");
    free(m);
    return NULL;
}

Status fmi2SetupExperiment(Handle i, Truth t, double tolerance, double start, Truth s, double stop) { (void)t, (void)tolerance, (void)s, (void)stop; return set_time(i, start); }
Status fmi2EnterInitializationMode(Handle i) { (void)i; return fmi2OK; }
Status fmi2GetReal(Handle i, const Reference r[], size_t n, double x[]) { return get(i, r, n, x); }
Status fmi2SetReal(Handle i, const Reference r[], size_t n, const double x[]) { return set(i, r, n, x); }
#define WITHOUT(T) \
    Status fmi2Get##T(Handle i, const Reference r[], size_t n, fmi2##T x[]) { (void)r, (void)x; return n ? fail(i, "all variables are Real") : fmi2OK; } \
    Status fmi2Set##T(Handle i, const Reference r[], size_t n, const fmi2##T x[]) { (void)r, (void)x; return n ? fail(i, "all variables are Real") : fmi2OK; }
WITHOUT(Integer)
WITHOUT(Boolean)
WITHOUT(String)
Status fmi2GetFMUstate(Handle i, Saved *s) { return save(i, s); }
Status fmi2SetFMUstate(Handle i, Saved s) { return restore(i, s); }
Status fmi2FreeFMUstate(Handle i, Saved *s) { (void)i; free(*s); *s = NULL; return fmi2OK; }
Status fmi2SerializedFMUstateSize(Handle i, Saved s, size_t *size) { (void)i, (void)s; *size = sizeof(State); return fmi2OK; }
Status fmi2SerializeFMUstate(Handle i, Saved s, fmi2Byte b[], size_t size) { return write_bytes(i, s, b, size); }
Status fmi2DeSerializeFMUstate(Handle i, const fmi2Byte b[], size_t size, Saved *s) { return read_bytes(i, b, size, s); }
Status fmi2GetDirectionalDerivative(Handle i, const Reference u[], size_t nu, const Reference k[], size_t nk, const double dk[], double du[]) { (void)u, (void)nu, (void)k, (void)nk, (void)dk, (void)du; return fail(i, "no directional derivatives"); }
Status fmi2NewDiscreteStates(Handle i, fmi2EventInfo *info) { (void)i; memset(info, 0, sizeof *info); return fmi2OK; }
Status fmi2GetDerivatives(Handle i, double dx[], size_t n) { return get_rates(i, dx, n); }
Status fmi2SetRealInputDerivatives(Handle i, const Reference r[], size_t n, const fmi2Integer o[], const double x[]) { (void)r, (void)n, (void)o, (void)x; return fail(i, "no derivatives of inputs; set drum_acceleration"); }
Status fmi2GetRealOutputDerivatives(Handle i, const Reference r[], size_t n, const fmi2Integer o[], double x[]) { (void)r, (void)n, (void)o, (void)x; return fail(i, "no derivatives of outputs"); }
Status fmi2DoStep(Handle i, double time, double length, Truth keep) { (void)keep; return do_step(i, time, length); }
Status fmi2CancelStep(Handle i) { return fail(i, "steps are not asynchronous"); }
Status fmi2GetStatus(Handle i, const fmi2StatusKind k, fmi2Status *s) { (void)i, (void)k; *s = fmi2OK; return fmi2Discard; }
Status fmi2GetRealStatus(Handle i, const fmi2StatusKind k, double *x) { *x = ((Machine *)i)->state.v[0]; return k == fmi2LastSuccessfulTime ? fmi2OK : fmi2Discard; }
Status fmi2GetIntegerStatus(Handle i, const fmi2StatusKind k, fmi2Integer *x) { (void)i, (void)k; *x = 0; return fmi2Discard; }
Status fmi2GetBooleanStatus(Handle i, const fmi2StatusKind k, fmi2Boolean *x) { (void)i; *x = 0; return k == fmi2Terminated ? fmi2OK : fmi2Discard; }
Status fmi2GetStringStatus(Handle i, const fmi2StatusKind k, Text *x) { (void)i, (void)k; *x = ""; return fmi2Discard; }

#else

const char *fmi3GetVersion(void) { return fmi3Version; }

static Machine *create3(Text name, Text token, bool exchange, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    Machine *m = create(name, exchange);
    if (!m) return NULL;
    m->environment = environment, m->log = log;
    if (token && !strcmp(token, WM_TOKEN)) return m;
    fail(m, "the instantiation token is not that of this FMU");
    free(m);
    return NULL;
}

fmi3Instance fmi3InstantiateModelExchange(Text name, Text token, Text resources, Truth visible, Truth logging,
                                          fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    (void)resources, (void)visible, (void)logging;
    return create3(name, token, true, environment, log);
}

fmi3Instance fmi3InstantiateCoSimulation(Text name, Text token, Text resources, Truth visible, Truth logging,
                                         Truth events, Truth early, const Reference r[], size_t n,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    (void)resources, (void)visible, (void)logging, (void)events, (void)early, (void)r, (void)n, (void)update;
    return create3(name, token, false, environment, log);
}

fmi3Instance fmi3InstantiateScheduledExecution(Text name, Text token, Text resources, Truth visible, Truth logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback clock, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)clock, (void)lock, (void)unlock;
    if (log) log(environment, fmi3Error, "logStatusError", "no scheduled execution");
    return NULL;
}

Status fmi3EnterInitializationMode(Handle i, Truth t, double tolerance, double start, Truth s, double stop) { (void)t, (void)tolerance, (void)s, (void)stop; return set_time(i, start); }
Status fmi3GetFloat64(Handle i, const Reference r[], size_t n, double x[], size_t m) { return n == m ? get(i, r, n, x) : fail(i, "wrong number of values"); }
Status fmi3SetFloat64(Handle i, const Reference r[], size_t n, const double x[], size_t m) { return n == m ? set(i, r, n, x) : fail(i, "wrong number of values"); }
#define WITHOUT(T) \
    Status fmi3Get##T(Handle i, const Reference r[], size_t n, fmi3##T x[], size_t m) { (void)r, (void)x, (void)m; return n ? fail(i, "all variables are Float64") : fmi3OK; } \
    Status fmi3Set##T(Handle i, const Reference r[], size_t n, const fmi3##T x[], size_t m) { (void)r, (void)x, (void)m; return n ? fail(i, "all variables are Float64") : fmi3OK; }
WITHOUT(Float32)
WITHOUT(Int8)
WITHOUT(UInt8)
WITHOUT(Int16)
WITHOUT(UInt16)
WITHOUT(Int32)
WITHOUT(UInt32)
WITHOUT(Int64)
WITHOUT(UInt64)
WITHOUT(Boolean)
WITHOUT(String)
#define NO(name, ...) Status fmi3##name(Handle i, __VA_ARGS__) { return fail(i, "fmi3" #name " is not supported"); }
NO(GetBinary, const Reference r[], size_t n, size_t s[], fmi3Binary x[], size_t m)
NO(SetBinary, const Reference r[], size_t n, const size_t s[], const fmi3Binary x[], size_t m)
NO(GetClock, const Reference r[], size_t n, fmi3Clock x[])
NO(SetClock, const Reference r[], size_t n, const fmi3Clock x[])
NO(GetNumberOfVariableDependencies, Reference r, size_t *n)
NO(GetVariableDependencies, Reference r, size_t e[], Reference x[], size_t f[], fmi3DependencyKind k[], size_t n)
NO(GetDirectionalDerivative, const Reference u[], size_t nu, const Reference k[], size_t nk, const double s[], size_t ns, double d[], size_t nd)
NO(GetAdjointDerivative, const Reference u[], size_t nu, const Reference k[], size_t nk, const double s[], size_t ns, double d[], size_t nd)
NO(GetIntervalDecimal, const Reference r[], size_t n, double x[], fmi3IntervalQualifier q[])
NO(GetIntervalFraction, const Reference r[], size_t n, fmi3UInt64 x[], fmi3UInt64 y[], fmi3IntervalQualifier q[])
NO(GetShiftDecimal, const Reference r[], size_t n, double x[])
NO(GetShiftFraction, const Reference r[], size_t n, fmi3UInt64 x[], fmi3UInt64 y[])
NO(SetIntervalDecimal, const Reference r[], size_t n, const double x[])
NO(SetIntervalFraction, const Reference r[], size_t n, const fmi3UInt64 x[], const fmi3UInt64 y[])
NO(SetShiftDecimal, const Reference r[], size_t n, const double x[])
NO(SetShiftFraction, const Reference r[], size_t n, const fmi3UInt64 x[], const fmi3UInt64 y[])
NO(GetOutputDerivatives, const Reference r[], size_t n, const fmi3Int32 o[], double x[], size_t m)
NO(ActivateModelPartition, Reference r, double time)
Status fmi3EnterConfigurationMode(Handle i) { (void)i; return fmi3OK; }
Status fmi3ExitConfigurationMode(Handle i) { (void)i; return fmi3OK; }
Status fmi3EvaluateDiscreteStates(Handle i) { (void)i; return fmi3OK; }
Status fmi3EnterStepMode(Handle i) { (void)i; return fmi3OK; }
Status fmi3GetFMUState(Handle i, Saved *s) { return save(i, s); }
Status fmi3SetFMUState(Handle i, Saved s) { return restore(i, s); }
Status fmi3FreeFMUState(Handle i, Saved *s) { (void)i; free(*s); *s = NULL; return fmi3OK; }
Status fmi3SerializedFMUStateSize(Handle i, Saved s, size_t *size) { (void)i, (void)s; *size = sizeof(State); return fmi3OK; }
Status fmi3SerializeFMUState(Handle i, Saved s, fmi3Byte b[], size_t size) { return write_bytes(i, s, b, size); }
Status fmi3DeserializeFMUState(Handle i, const fmi3Byte b[], size_t size, Saved *s) { return read_bytes(i, b, size, s); }
Status fmi3UpdateDiscreteStates(Handle i, Truth *again, Truth *end, Truth *nominals, Truth *values, Truth *next, double *time) {
    (void)i;
    *again = *end = *nominals = *values = *next = false;
    *time = 0.0;
    return fmi3OK;
}
Status fmi3GetContinuousStateDerivatives(Handle i, double dx[], size_t n) { return get_rates(i, dx, n); }
Status fmi3GetNumberOfEventIndicators(Handle i, size_t *n) { (void)i; *n = 0; return fmi3OK; }
Status fmi3GetNumberOfContinuousStates(Handle i, size_t *n) { (void)i; *n = WM_STATES; return fmi3OK; }
Status fmi3DoStep(Handle i, double time, double length, Truth keep, Truth *event, Truth *end, Truth *early, double *last) {
    (void)keep;
    Machine *m = i;
    *event = *end = *early = false;
    Status status = do_step(m, time, length);
    *last = status == fmi3OK ? time + length : time;
    return status;
}

#endif
