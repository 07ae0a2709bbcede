/* The far side of magsteer's UDP protocol: amplifiers with a watchdog of their own, frames, a tracker.
 *
 * It simulates ideal hardware: replace what is marked HARDWARE, and keep `magsteer hal conformance` passing.
 * Every datagram is described in UDP.md. Units: A, rad, m, s; little-endian, doubles are IEEE 754.
 */
#define _POSIX_C_SOURCE 200809L
#include <arpa/inet.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>

#include "rig.h"

#define VALUES (RIG_COILS + RIG_FRAMES)
#define HEAD 24
#define LENGTH (HEAD + 8 * VALUES)
#define MAGNET 64
#define POSES_LENGTH (24 + MAGNET * RIG_MAGNETS)

enum { FOLLOW = 1, CUT = 2 };                          /* request kind */
enum { STATE_FOLLOWING = 0, STATE_EXPIRED = 1, STATE_CUT = 2 };

static const double time_constant_s = 0.002, pose_period_s = 0.005;

static double wanted[VALUES + 1], measured[VALUES + 1]; /* currents, then angles; one more: no array is empty */
static uint64_t newest = 0, pose_sequence = 0;
static uint32_t state = STATE_EXPIRED;
static double deadline_s = 0.0, stepped_s = 0.0, pose_due_s = 0.0;

static double now_s(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

static uint64_t get(const uint8_t *bytes, int count) {
    uint64_t value = 0;
    for (int i = count - 1; i >= 0; i--) value = value << 8 | bytes[i];
    return value;
}

static void put(uint8_t *bytes, uint64_t value, int count) {
    for (int i = 0; i < count; i++, value >>= 8) bytes[i] = (uint8_t)value;
}

static double get_real(const uint8_t *bytes) {
    uint64_t bits = get(bytes, 8);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static void put_real(uint8_t *bytes, double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    put(bytes, bits, 8);
}

/* Lets time pass: without requests set points ramp to zero, and the hardware follows. */
static void step(double now) {
    double period = now - stepped_s;
    stepped_s = now;
    if (state == STATE_FOLLOWING && now >= deadline_s) state = STATE_EXPIRED;
    for (int i = 0; i < RIG_COILS; i++) {
        if (state == STATE_EXPIRED) {
            double most = rig_slew_max_a_per_s[i] * period;
            wanted[i] -= fmin(fmax(wanted[i], -most), most);
        }
        /* HARDWARE: send wanted[i] (A) to amplifier i and read its sensor into measured[i]. */
        measured[i] += (1.0 - exp(-period / time_constant_s)) * (wanted[i] - measured[i]);
    }
    for (int i = RIG_COILS; i < VALUES; i++) {
        /* HARDWARE: send wanted[i] (rad) to the motor of frame i - RIG_COILS and read its encoder. */
        measured[i] = wanted[i];
    }
}

static void cut(void) {
    state = STATE_CUT;
    /* HARDWARE: take the enable line of the amplifiers away here. */
    for (int i = 0; i < RIG_COILS; i++) wanted[i] = measured[i] = 0.0;
}

/* Obeys a request; returns 0 for what is none, or came late. */
static int take(const uint8_t *bytes, ssize_t length, double now) {
    if (length != LENGTH || memcmp(bytes, "MSR1", 4) != 0) return 0;
    if (get(bytes + 20, 2) != RIG_COILS || get(bytes + 22, 2) != RIG_FRAMES) return 0;
    uint64_t sequence = get(bytes + 8, 8);
    if (sequence <= newest) return 0;
    for (int i = 0; i < VALUES; i++)
        if (!isfinite(get_real(bytes + HEAD + 8 * i))) return 0;
    newest = sequence;
    if (get(bytes + 4, 4) == FOLLOW) {
        for (int i = 0; i < VALUES; i++) wanted[i] = get_real(bytes + HEAD + 8 * i);
        state = STATE_FOLLOWING;
        deadline_s = now + 1e-6 * (double)get(bytes + 16, 4);
    } else {
        cut();
    }
    return 1;
}

static void answer(int socket, const struct sockaddr *to, socklen_t size) {
    uint8_t bytes[LENGTH];
    memcpy(bytes, "MSA1", 4);
    put(bytes + 4, state, 4);
    put(bytes + 8, newest, 8);
    put(bytes + 16, 0, 4); /* HARDWARE: your fault code, 0 for none; any other makes the driver cut. */
    put(bytes + 20, RIG_COILS, 2);
    put(bytes + 22, RIG_FRAMES, 2);
    for (int i = 0; i < VALUES; i++) put_real(bytes + HEAD + 8 * i, measured[i]);
    sendto(socket, bytes, sizeof bytes, 0, to, size);
}

static void poses(int socket, const struct sockaddr *to, socklen_t size) {
    uint8_t bytes[POSES_LENGTH];
    memset(bytes, 0, sizeof bytes);
    memcpy(bytes, "MSP1", 4);
    put(bytes + 4, 0, 4); /* HARDWARE: microseconds from exposure to now. */
    put(bytes + 8, ++pose_sequence, 8);
    put(bytes + 16, RIG_MAGNETS, 4);
    for (int i = 0; i < RIG_MAGNETS; i++) {
        /* HARDWARE: position, m, and orientation x, y, z, w of magnet i; the last word is 0 when it was not seen. */
        for (int k = 0; k < 7; k++) put_real(bytes + 24 + MAGNET * i + 8 * k, rig_straight_rod[i][k]);
        put(bytes + 24 + MAGNET * i + 56, 1, 4);
    }
    sendto(socket, bytes, sizeof bytes, 0, to, size);
}

int main(int count, char **arguments) {
    int port = count > 1 ? atoi(arguments[1]) : 9077;
    int handle = socket(AF_INET, SOCK_DGRAM, 0);
    struct sockaddr_in own = {0}, driver = {0};
    socklen_t size = sizeof driver;
    struct timeval wait = {0, 1000};
    own.sin_family = AF_INET;
    own.sin_port = htons((uint16_t)port);
    own.sin_addr.s_addr = htonl(INADDR_LOOPBACK); /* INADDR_ANY for a driver on another computer */
    if (handle < 0 || bind(handle, (struct sockaddr *)&own, sizeof own) != 0) {
        perror("device: no socket");
        return 1;
    }
    setsockopt(handle, SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof wait);
    printf("device of %s listens on port %d\n", RIG_NAME, port);
    fflush(stdout);
    stepped_s = now_s();
    for (;;) {
        uint8_t bytes[2048];
        struct sockaddr_in from = {0};
        socklen_t from_size = sizeof from;
        ssize_t length = recvfrom(handle, bytes, sizeof bytes, 0, (struct sockaddr *)&from, &from_size);
        double now = now_s();
        step(now);
        if (length > 0 && take(bytes, length, now)) {
            driver = from;
            size = from_size;
            answer(handle, (struct sockaddr *)&driver, size);
        }
        if (newest > 0 && now >= pose_due_s) {
            pose_due_s = now + pose_period_s;
            poses(handle, (struct sockaddr *)&driver, size);
        }
    }
}
