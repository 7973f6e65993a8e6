/* The floor: what the chain from bytes to message costs in a small C program on the same machine.
 *
 * The job of the daemon with one force sensor, without its decisions: read the port, find frames, check them, subtract
 * an offset, move the wrench to the pad, pack the message `wrench.left` with the same keys, publish it.
 * One thread, poll and non-blocking read, no allocation in the loop.
 *
 *   floor LIBZMQ TTY ENDPOINT BOOT CONFIG_ID R(9, row by row) LEVER(3) OFFSET(6)
 *
 * libzmq is opened at run time by its path, so neither its headers nor a link name are needed to build this.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

enum { FRAME = 37, HEADER = 0xAA, BUFFER = 4096, MESSAGE = 1024, ARGUMENTS = 24, WAKE_MS = 1000 };
enum { ZMQ_PUB = 1, ZMQ_DONTWAIT = 1, ZMQ_SNDMORE = 2, ZMQ_LINGER = 17 }; /* zmq.h, since version 3 */

static void *(*zmq_ctx_new)(void);
static int (*zmq_ctx_term)(void *);
static void *(*zmq_socket)(void *, int);
static int (*zmq_setsockopt)(void *, int, const void *, size_t);
static int (*zmq_bind)(void *, const char *);
static int (*zmq_send)(void *, const void *, size_t, int);
static int (*zmq_close)(void *);

static volatile sig_atomic_t stopped;

static const char topic[] = "wrench.left";
static const char *boot, *config_id;
static double rotation[9], lever[3], offset[6];
static uint64_t seq;
static int64_t wall_minus_monotonic_ns;

static void stop(int number) {
    (void)number;
    stopped = 1;
}

static void fail(const char *what) {
    fprintf(stderr, "floor: %s: %s\n", what, errno ? strerror(errno) : "failed");
    exit(1);
}

static int64_t now_ns(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

/* ---- libzmq ---- */

static void *symbol(void *library, const char *name) {
    void *found = dlsym(library, name);
    if (!found) {
        fprintf(stderr, "floor: %s\n", dlerror());
        exit(1);
    }
    return found;
}

static void open_zmq(const char *path) {
    void *library = dlopen(path, RTLD_NOW);
    if (!library) {
        fprintf(stderr, "floor: %s\n", dlerror());
        exit(1);
    }
    *(void **)&zmq_ctx_new = symbol(library, "zmq_ctx_new");
    *(void **)&zmq_ctx_term = symbol(library, "zmq_ctx_term");
    *(void **)&zmq_socket = symbol(library, "zmq_socket");
    *(void **)&zmq_setsockopt = symbol(library, "zmq_setsockopt");
    *(void **)&zmq_bind = symbol(library, "zmq_bind");
    *(void **)&zmq_send = symbol(library, "zmq_send");
    *(void **)&zmq_close = symbol(library, "zmq_close");
}

/* ---- CRC-16/X-25 ---- */

static uint16_t crc_table[256];

static void make_crc_table(void) {
    for (int byte = 0; byte < 256; byte++) {
        uint16_t value = (uint16_t)byte;
        for (int bit = 0; bit < 8; bit++) value = value & 1 ? value >> 1 ^ 0x8408 : value >> 1;
        crc_table[byte] = value;
    }
}

static int checksum_holds(const uint8_t *frame) {
    uint16_t crc = 0xFFFF;
    for (int i = 1; i < FRAME - 2; i++) crc = crc >> 8 ^ crc_table[(crc ^ frame[i]) & 0xFF];
    crc ^= 0xFFFF;
    return frame[FRAME - 2] == (crc & 0xFF) && frame[FRAME - 1] == crc >> 8;
}

/* ---- msgpack ---- */

static uint8_t *big_endian(uint8_t *at, uint64_t value, int bytes) {
    for (int i = bytes - 1; i >= 0; i--) *at++ = (uint8_t)(value >> 8 * i);
    return at;
}

static uint8_t *put_text(uint8_t *at, const char *text) { /* below 32 bytes, as all of ours */
    size_t length = strlen(text);
    *at++ = (uint8_t)(0xA0 | length);
    memcpy(at, text, length);
    return at + length;
}

static uint8_t *put_unsigned(uint8_t *at, uint64_t value) { /* in the shortest form, as every packer does */
    if (value < 0x80) return big_endian(at, value, 1);
    int bytes = value <= 0xFF ? 1 : value <= 0xFFFF ? 2 : value <= 0xFFFFFFFF ? 4 : 8;
    *at++ = bytes == 1 ? 0xCC : bytes == 2 ? 0xCD : bytes == 4 ? 0xCE : 0xCF;
    return big_endian(at, value, bytes);
}

static uint8_t *put_double(uint8_t *at, double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    *at++ = 0xCB;
    return big_endian(at, bits, 8);
}

static uint8_t *put_doubles(uint8_t *at, const double *values, int count) {
    *at++ = (uint8_t)(0x90 | count);
    for (int i = 0; i < count; i++) at = put_double(at, values[i]);
    return at;
}

/* ---- a reading ---- */

static void to_pad(const float *reading, double *force, double *torque) {
    double f[3], m[3];
    for (int i = 0; i < 3; i++) {
        f[i] = reading[i] - offset[i];
        m[i] = reading[i + 3] - offset[i + 3];
    }
    for (int i = 0; i < 3; i++) {
        force[i] = rotation[3 * i] * f[0] + rotation[3 * i + 1] * f[1] + rotation[3 * i + 2] * f[2];
        torque[i] = rotation[3 * i] * m[0] + rotation[3 * i + 1] * m[1] + rotation[3 * i + 2] * m[2];
    }
    torque[0] += lever[1] * force[2] - lever[2] * force[1];
    torque[1] += lever[2] * force[0] - lever[0] * force[2];
    torque[2] += lever[0] * force[1] - lever[1] * force[0];
}

static size_t pack(uint8_t *message, int64_t t_ns, const double *force, const double *torque) {
    uint8_t *at = message;
    *at++ = 0xDE; /* 16 keys are one too many for the short form */
    at = big_endian(at, 16, 2);
    at = put_unsigned(put_text(at, "v"), 1);
    at = put_unsigned(put_text(at, "seq"), seq++);
    at = put_text(put_text(at, "boot"), boot);
    at = put_unsigned(put_text(at, "t_ns"), (uint64_t)t_ns);
    at = put_double(put_text(at, "timestamp"), (double)(t_ns + wall_minus_monotonic_ns) * 1e-9);
    at = put_text(put_text(at, "frame"), "left_pad");
    at = put_text(put_text(at, "config_id"), config_id);
    at = put_text(put_text(at, "finger"), "left");
    at = put_text(put_text(at, "force_unit"), "N");
    at = put_doubles(put_text(at, "force_n"), force, 3);
    at = put_doubles(put_text(at, "torque_nm"), torque, 3);
    at = put_double(put_text(at, "normal_n"), -force[2]);
    at = put_doubles(put_text(at, "tangential_n"), force, 2);
    at = put_doubles(put_text(at, "status"), NULL, 0);
    at = put_unsigned(put_text(at, "tare_id"), 0);
    at = put_double(put_text(at, "age_s"), 0.0);
    return (size_t)(at - message);
}

static void publish(void *socket, const uint8_t *frame, int64_t t_ns) {
    uint8_t message[MESSAGE];
    float reading[6];
    double force[3], torque[3];
    memcpy(reading, frame + 3, sizeof reading); /* little-endian, as is this machine */
    to_pad(reading, force, torque);
    size_t length = pack(message, t_ns, force, torque);
    if (zmq_send(socket, topic, sizeof topic - 1, ZMQ_SNDMORE | ZMQ_DONTWAIT) >= 0)
        zmq_send(socket, message, length, ZMQ_DONTWAIT);
}

/* Publishes every frame in the buffer and returns how many bytes of a begun one remain at its start. */
static size_t take(void *socket, uint8_t *buffer, size_t filled, int64_t t_ns) {
    size_t at = 0;
    while (at + FRAME <= filled) {
        if (buffer[at] == HEADER && checksum_holds(buffer + at)) {
            publish(socket, buffer + at, t_ns);
            at += FRAME;
        } else {
            at++;
        }
    }
    memmove(buffer, buffer + at, filled - at);
    return filled - at;
}

static void serve(int port, void *socket) {
    uint8_t buffer[BUFFER];
    size_t filled = 0;
    struct pollfd wait = {.fd = port, .events = POLLIN};
    while (!stopped) {
        if (poll(&wait, 1, WAKE_MS) <= 0) continue; /* a signal, or one that came just before poll */
        ssize_t got = read(port, buffer + filled, sizeof buffer - filled);
        if (got > 0)
            filled = take(socket, buffer, filled + (size_t)got, now_ns(CLOCK_MONOTONIC));
        else if (got == 0 || errno != EAGAIN)
            return;
    }
}

static int open_port(const char *path) {
    struct termios mode;
    int port = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (port < 0 || tcgetattr(port, &mode) < 0) fail("port");
    cfmakeraw(&mode);
    if (tcsetattr(port, TCSANOW, &mode) < 0) fail("port");
    return port;
}

int main(int count, char **arguments) {
    if (count != ARGUMENTS) {
        fprintf(stderr, "floor: LIBZMQ TTY ENDPOINT BOOT CONFIG_ID and 18 numbers are expected\n");
        return 2;
    }
    boot = arguments[4];
    config_id = arguments[5];
    for (int i = 0; i < 9; i++) rotation[i] = atof(arguments[6 + i]);
    for (int i = 0; i < 3; i++) lever[i] = atof(arguments[15 + i]);
    for (int i = 0; i < 6; i++) offset[i] = atof(arguments[18 + i]);
    wall_minus_monotonic_ns = now_ns(CLOCK_REALTIME) - now_ns(CLOCK_MONOTONIC);
    make_crc_table();

    struct sigaction action = {.sa_handler = stop}; /* without SA_RESTART: poll must end */
    sigaction(SIGTERM, &action, NULL);
    open_zmq(arguments[1]);
    int port = open_port(arguments[2]);
    void *context = zmq_ctx_new();
    void *socket = zmq_socket(context, ZMQ_PUB);
    int linger = 0;
    zmq_setsockopt(socket, ZMQ_LINGER, &linger, sizeof linger);
    if (zmq_bind(socket, arguments[3]) < 0) fail("endpoint");
    puts("ready");
    fflush(stdout);

    serve(port, socket);
    zmq_close(socket);
    zmq_ctx_term(context);
    return 0;
}
