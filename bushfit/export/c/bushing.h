/* A rubber bushing in time: displacement in, force out. The laws are those of bushfit's effects. */
#ifndef BUSHING_H
#define BUSHING_H
#include "model.h"

enum { FRICTIONS = 2, SLIDERS = 100, ELEMENTS = 120 };

/* Where on the list of values each quantity of one direction stands; 0 and 1 stand there too, for what it has not. */
typedef struct {
    int unit_strain, stiffness_per_modulus;                /* [1/m or 1/rad], [m or m^3/rad] */
    int mu, c2, c3, c5;                                    /* elastic stress 2 mu (e + c2 e^2 + c3 e^3 + c5 e^5) */
    int size[PARTS];                                       /* what the moduli of the arms of each part go with */
    int sigma_fmax[FRICTIONS], eps_half[FRICTIONS];        /* friction, Eq. 5 */
    int sigma, e_s, spread;                                /* springs with sliders */
    int delta, median, deviation;                          /* springs with log-normally distributed sliders */
    int scale, play, slip, gap, stop, one_gap, one_stop;   /* layers, from the rubber outward */
    int factor, preload, give, own_give;
    double lever;                                          /* arm of the slip force: 1, or a radius in torsion [m] */
} Direction;

typedef struct {
    int part;
    double share, time; /* modulus over the size of its part, and relaxation time [s] */
} Arm;

/* What the rubber of one direction remembers. */
typedef struct {
    double displacement, strain;
    double arm[ARMS];                                      /* strain of each arm's spring */
    double sense, turn;                                    /* of the motion, and where it turned last */
    double turned[FRICTIONS], friction[FRICTIONS];         /* friction stress over sigma_fmax: there, and now */
    double slider[SLIDERS];                                /* stress of each over its largest */
    double element[ELEMENTS];                              /* the same of the distributed ones */
} Memory;

/* What a time step leaves of the strain of each arm's spring, and what it keeps of a strain that grows meanwhile. */
typedef struct {
    double step, left[ARMS], kept[ARMS];
} Decay;

extern const double start[VALUES];
extern const double least[VALUES], most[VALUES];
extern const Direction directions[DIRECTIONS];
extern const Arm arms[ARMS];

void set_step(Decay *decay, double step);
double move(const Direction *at, const double *value, const Decay *decay, const Memory *was, Memory *is, double to);
#endif
