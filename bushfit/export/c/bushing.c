/* The laws of a bushing, stepped through time; a motion goes straight from one sample to the next. */
#include "bushing.h"

enum { ROUNDS = 100 };                    /* of the search for the motion behind what gives way: bisection takes 60 */
static const double TOLERANCE = 1e-14;    /* of that motion, relative: rounding */

/* exp(-y) and (1 - exp(-y))/y for y >= 0: the series of a small part of y, doubled up; no library is needed. */
static double decayed(double y, double *kept)
{
    int doublings = 0;
    double left, mean, term = 1.0;
    for (; y > 0.125; y *= 0.5)
        doublings++;
    mean = 1.0;
    for (int k = 2; k < 12; k++)
        mean += term *= -y / k;
    for (left = 1.0 - y * mean; doublings; doublings--) {
        mean *= 0.5 * (1.0 + left);
        left *= left;
    }
    if (kept)
        *kept = mean;
    return left;
}

static double exponential(double x)
{
    return x < 0.0 ? decayed(-x, 0) : 1.0 / decayed(x, 0);
}

/* What of x lies beyond +-width. */
static double beyond(double x, double width)
{
    return x > width ? x - width : x < -width ? x + width : 0.0;
}

static double sign(double x)
{
    return (x > 0.0) - (x < 0.0);
}

/* Arms by their exact solution over a step in which the strain changes evenly. */
void set_step(Decay *decay, double step)
{
    decay->step = step;
    for (int k = 0; k < ARMS; k++)
        decay->left[k] = decayed(step / arms[k].time, &decay->kept[k]);
}

static double limited(double x)
{
    return x > 1.0 ? 1.0 : x < -1.0 ? -1.0 : x;
}

/* Standard normal deviate of an element of the distributed sliders, and the strain at which it yields. */
static double deviate(int k)
{
    return 4.5 * ((2.0 * k + 1.0) / ELEMENTS - 1.0);
}

static double yield_strain(const Direction *at, const double *value, int k)
{
    return value[at->median] * exponential(value[at->deviation] * deviate(k));
}

/* Friction, Eq. 5: u = u_s + sgn d v/(v + d), v = 1 - sgn u_s, d the way from the last turning point over eps_half. */
static void rub(const Direction *at, const double *value, const Memory *was, Memory *is, double change)
{
    double sense = sign(change);
    if (sense * was->sense < 0.0) {
        is->turn = was->strain;
        for (int k = 0; k < FRICTIONS; k++)
            is->turned[k] = was->friction[k];
    }
    is->sense = sense;
    for (int k = 0; k < FRICTIONS; k++) {
        double way = sense * (is->strain - is->turn) / value[at->eps_half[k]];
        double room = 1.0 - sense * is->turned[k];
        is->friction[k] = is->turned[k] + (way > 0.0 ? sense * way * room / (room + way) : 0.0);
    }
    if (value[at->sigma] > 0.0)
        for (int k = 0; k < SLIDERS; k++) {
            double place = (2.0 * k + 1.0) / SLIDERS - 1.0;
            double slip = value[at->e_s] * exponential(value[at->spread] * place);
            double held = was->slider[k] + change / slip;
            is->slider[k] = limited(held);
        }
    if (value[at->delta] > 0.0)
        for (int k = 0; k < ELEMENTS; k++)
            is->element[k] = limited(was->element[k] + change / yield_strain(at, value, k));
}

/* Mean strain of the springs with distributed sliders: the elements have normally distributed shares. */
static double distributed(const Direction *at, const double *value, const Memory *is)
{
    double total = 0.0, shares = 0.0;
    for (int k = 0; k < ELEMENTS; k++) {
        double share = exponential(-0.5 * deviate(k) * deviate(k));
        total += share * yield_strain(at, value, k) * is->element[k];
        shares += share;
    }
    return total / shares;
}

/* Stress [Pa] at a strain, and the memory that it leaves. */
static double stress(
    const Direction *at, const double *value, const Decay *decay, const Memory *was, Memory *is, double strain)
{
    double square = strain * strain, change = strain - was->strain, sliding = 0.0;
    double shape = 1.0 + value[at->c2] * strain + value[at->c3] * square + value[at->c5] * square * square;
    double total = 2.0 * value[at->mu] * strain * shape;
    is->strain = strain;
    for (int k = 0; k < ARMS; k++) {
        is->arm[k] = decay->left[k] * was->arm[k] + decay->kept[k] * change;
        total += 2.0 * value[at->size[arms[k].part]] * arms[k].share * is->arm[k];
    }
    if (change != 0.0)
        rub(at, value, was, is, change);
    for (int k = 0; k < FRICTIONS; k++)
        total += value[at->sigma_fmax[k]] * is->friction[k];
    for (int k = 0; k < SLIDERS; k++)
        sliding += is->slider[k];
    if (value[at->delta] > 0.0)
        total += 2.0 * value[at->delta] * distributed(at, value, is);
    return total + value[at->sigma] * sliding / SLIDERS;
}

/* Force [N or N m] of a motion of the bushing itself, `sense` being that of what drives it. */
static double force(const Direction *at, const double *value, const Decay *decay, const Memory *was, Memory *is,
                    double displacement, double sense)
{
    double scale = value[at->scale], strained = value[at->unit_strain], total, over;
    *is = *was;
    total = stress(at, value, decay, was, is, strained * scale * beyond(displacement, value[at->play]));
    total *= value[at->stiffness_per_modulus] / (2.0 * strained * scale);
    total += value[at->slip] * at->lever * sense + value[at->stop] * beyond(displacement, value[at->gap]);
    over = displacement - value[at->one_gap];
    total += over > 0.0 ? value[at->one_stop] * over : 0.0;
    return total * value[at->factor] * value[at->preload];
}

/* The force after a motion from where the memory ends, and the memory that it leaves.

   Where a sleeve gives way, the bushing moves by x_b = to - give F(x_b); F grows with x_b, so that the root lies between
   what is imposed and what the force of that would leave of it: regula falsi, in Illinois form, finds it. */
double move(const Direction *at, const double *value, const Decay *decay, const Memory *was, Memory *is, double to)
{
    double give = value[at->give] + value[at->own_give], sense = sign(to - was->displacement);
    double felt = force(at, value, decay, was, is, to, sense);
    double one = to, off = give * felt, other = to - off, other_off, size = to < 0.0 ? -to : to;
    int side = 0;
    if (off != 0.0) {
        other_off = other - to + give * force(at, value, decay, was, is, other, sense);
        for (int round = 0; round < ROUNDS && other_off != 0.0; round++) {
            double middle = round % 3 == 2 ? 0.5 * (one + other) : (one * other_off - other * off) / (other_off - off);
            felt = force(at, value, decay, was, is, middle, sense);
            double found = middle - to + give * felt;
            if ((found < 0.0 ? -found : found) <= TOLERANCE * size)
                break;
            if (sign(found) == sign(off)) {
                one = middle, off = found;
                other_off *= side == 1 ? 0.5 : 1.0;
                side = 1;
            } else {
                other = middle, other_off = found;
                off *= side == -1 ? 0.5 : 1.0;
                side = -1;
            }
        }
        if (other_off == 0.0)
            felt = force(at, value, decay, was, is, other, sense);
    }
    is->displacement = to;
    return felt;
}
