/* FMI 2.0 for co-simulation around the bushing of bushing.c; the specification's words stand where they can. */
#include "fmi2.h"
#include "bushing.h"

typedef struct {
    double value[VALUES], input[DIRECTIONS], slope[DIRECTIONS], output[DIRECTIONS];
    Memory memory[DIRECTIONS];
    Decay decay;
    int running; /* whether initialization is over */
} State;

typedef struct {
    State now;
    fmi2CallbackFunctions call;
    fmi2String name;
} Instance;

#if defined(FREESTANDING) /* a compiler may ask for these two of its own; all that is copied here are doubles */
void *memcpy(void *to, const void *from, size_t count)
{
    size_t words = count / sizeof(double);
    for (size_t k = 0; k < words; k++)
        ((double *)to)[k] = ((const double *)from)[k];
    for (size_t k = words * sizeof(double); k < count; k++)
        ((char *)to)[k] = ((const char *)from)[k];
    return to;
}

void *memset(void *to, int byte, size_t count)
{
    for (size_t k = 0; k < count; k++)
        ((char *)to)[k] = (char)byte;
    return to;
}
#if defined(_WIN32)
int _fltused = 1;

int __stdcall DllMainCRTStartup(void *library, unsigned reason, void *reserved)
{
    (void)library, (void)reason, (void)reserved;
    return 1;
}
#endif
#endif

static fmi2Status fail(const Instance *of, fmi2String said)
{
    if (of->call.logger)
        of->call.logger(of->call.componentEnvironment, of->name, fmi2Error, "error", "%s", said);
    return fmi2Error;
}

static int finite(double x)
{
    return x - x == 0.0;
}

/* From rest, and with the inputs that are set: what moves in no time has its full force. */
static void begin(State *now)
{
    static const Memory rest;
    set_step(&now->decay, 0.0);
    for (int k = 0; k < DIRECTIONS; k++) {
        Memory was = rest;
        now->output[k] = move(&directions[k], now->value, &now->decay, &was, &now->memory[k], now->input[k]);
    }
}

static void reset(State *now)
{
    static const State nothing;
    *now = nothing;
    for (int k = 0; k < VALUES; k++)
        now->value[k] = start[k];
}

EXPORT fmi2String fmi2GetTypesPlatform(void)
{
    return "default";
}

EXPORT fmi2String fmi2GetVersion(void)
{
    return "2.0";
}

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    (void)c, (void)on, (void)count, (void)categories;
    return fmi2OK;
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *call, fmi2Boolean visible, fmi2Boolean logging)
{
    Instance *made;
    size_t k = 0;
    (void)resources, (void)visible, (void)logging;
    if (!call || !call->allocateMemory || !call->freeMemory || !name || !guid)
        return NULL;
    while (guid[k] && guid[k] == GUID[k])
        k++;
    if (guid[k] != GUID[k] || type != fmi2CoSimulation) {
        if (call->logger)
            call->logger(call->componentEnvironment, name, fmi2Error, "error", "%s",
                         type == fmi2CoSimulation ? "modelDescription.xml is of another FMU" : "for co-simulation only");
        return NULL;
    }
    for (k = 0; name[k]; k++)
        ;
    made = call->allocateMemory(1, sizeof(Instance) + k + 1);
    if (!made)
        return NULL;
    char *kept = (char *)(made + 1);
    for (kept[k] = 0; k; k--)
        kept[k - 1] = name[k - 1];
    made->call = *call;
    made->name = kept;
    reset(&made->now);
    return made;
}

EXPORT void fmi2FreeInstance(fmi2Component c)
{
    if (c)
        ((Instance *)c)->call.freeMemory(c);
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean limited, fmi2Real tolerance, fmi2Real begins,
                                      fmi2Boolean ends, fmi2Real end)
{
    (void)c, (void)limited, (void)tolerance, (void)begins, (void)ends, (void)end;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    State *now = &((Instance *)c)->now;
    begin(now);
    now->running = 1;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Reset(fmi2Component c)
{
    reset(&((Instance *)c)->now);
    return fmi2OK;
}

/* References: the values, then the displacements, then the forces. */
EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference which[], size_t count, fmi2Real out[])
{
    State *now = &((Instance *)c)->now;
    for (size_t k = 0; k < count; k++) {
        fmi2ValueReference r = which[k];
        if (r >= VALUES + 2 * DIRECTIONS)
            return fail(c, "there is no such variable");
        if (r >= VALUES + DIRECTIONS && !now->running)
            begin(now);
        out[k] = r < VALUES                ? now->value[r]
                 : r < VALUES + DIRECTIONS ? now->input[r - VALUES]
                                           : now->output[r - VALUES - DIRECTIONS];
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference which[], size_t count, const fmi2Real in[])
{
    State *now = &((Instance *)c)->now;
    for (size_t k = 0; k < count; k++) {
        fmi2ValueReference r = which[k];
        if (r < CONSTANTS || r >= VALUES + DIRECTIONS)
            return fail(c, "this variable cannot be set");
        if (!finite(in[k]) || (r < VALUES && !(least[r] <= in[k] && in[k] <= most[r])))
            return fail(c, "a value outside the bounds that modelDescription.xml states");
        *(r < VALUES ? &now->value[r] : &now->input[r - VALUES]) = in[k];
    }
    return fmi2OK;
}

/* Where an input goes until the end of the next step; without, it stays. */
EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference which[], size_t count,
                                              const fmi2Integer order[], const fmi2Real in[])
{
    for (size_t k = 0; k < count; k++) {
        if (which[k] < VALUES || which[k] >= VALUES + DIRECTIONS || order[k] != 1 || !finite(in[k]))
            return fail(c, "only first derivatives of displacements can be set");
        ((Instance *)c)->now.slope[which[k] - VALUES] = in[k];
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean kept)
{
    State *now = &((Instance *)c)->now;
    (void)time, (void)kept;
    if (!now->running || !finite(step) || step < 0.0)
        return fail(c, "a step before initialization is over, or one that does not go forward");
    if (step != now->decay.step)
        set_step(&now->decay, step);
    for (int k = 0; k < DIRECTIONS; k++) {
        Memory was = now->memory[k];
        double to = now->input[k] + now->slope[k] * step;
        now->output[k] = move(&directions[k], now->value, &now->decay, &was, &now->memory[k], to);
        now->slope[k] = 0.0;
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    Instance *of = c;
    if (!*state)
        *state = of->call.allocateMemory(1, sizeof(State));
    if (!*state)
        return fail(of, "no memory for a state");
    *(State *)*state = of->now;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    ((Instance *)c)->now = *(State *)state;
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    if (*state)
        ((Instance *)c)->call.freeMemory(*state);
    *state = NULL;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    (void)c, (void)state;
    *size = sizeof(State);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    if (size < sizeof(State))
        return fail(c, "too few bytes for a state");
    for (size_t k = 0; k < sizeof(State); k++)
        bytes[k] = ((const fmi2Byte *)state)[k];
    return fmi2OK;
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    if (size != sizeof(State))
        return fail(c, "these bytes are no state of this FMU");
    if (fmi2GetFMUstate(c, state) != fmi2OK)
        return fmi2Error;
    for (size_t k = 0; k < size; k++)
        ((fmi2Byte *)*state)[k] = bytes[k];
    return fmi2OK;
}

/* There are no variables of other types; what is left of the interface says so. */
#define NO_VARIABLES(type)                                                                                            \
    EXPORT fmi2Status fmi2Get##type(fmi2Component c, const fmi2ValueReference r[], size_t count, fmi2##type out[])     \
    {                                                                                                                 \
        (void)r, (void)out;                                                                                           \
        return count ? fail(c, "all variables are real") : fmi2OK;                                                    \
    }                                                                                                                 \
    EXPORT fmi2Status fmi2Set##type(fmi2Component c, const fmi2ValueReference r[], size_t count, const fmi2##type in[]) \
    {                                                                                                                 \
        (void)r, (void)in;                                                                                            \
        return count ? fail(c, "all variables are real") : fmi2OK;                                                    \
    }
NO_VARIABLES(Integer)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

#define NO_STATUS(name, type)                                                                                         \
    EXPORT fmi2Status name(fmi2Component c, const fmi2StatusKind kind, type *out)                                      \
    {                                                                                                                 \
        (void)c, (void)kind, (void)out;                                                                               \
        return fmi2Discard;                                                                                           \
    }
NO_STATUS(fmi2GetStatus, fmi2Status)
NO_STATUS(fmi2GetRealStatus, fmi2Real)
NO_STATUS(fmi2GetIntegerStatus, fmi2Integer)
NO_STATUS(fmi2GetBooleanStatus, fmi2Boolean)
NO_STATUS(fmi2GetStringStatus, fmi2String)

EXPORT fmi2Status fmi2CancelStep(fmi2Component c)
{
    return fail(c, "steps are done at once");
}

EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference which[], size_t count,
                                               const fmi2Integer order[], fmi2Real out[])
{
    (void)which, (void)count, (void)order, (void)out;
    return fail(c, "forces have no derivatives here");
}

EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t unknowns,
                                               const fmi2ValueReference known[], size_t knowns, const fmi2Real by[],
                                               fmi2Real out[])
{
    (void)unknown, (void)unknowns, (void)known, (void)knowns, (void)by, (void)out;
    return fail(c, "there are no directional derivatives");
}
