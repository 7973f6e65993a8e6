/* The floor of a request: a bare ROUTER that sends every message back as it came.
 *
 *   echo LIBZMQ ENDPOINT
 *
 * libzmq is opened at run time by its path, so neither its headers nor a link name are needed to build this.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>

enum { FRAME = 65536, ZMQ_ROUTER = 6, ZMQ_RCVMORE = 13, ZMQ_SNDMORE = 2 }; /* zmq.h, since version 3 */

static void *symbol(void *library, const char *name) {
    void *found = library ? dlsym(library, name) : NULL;
    if (!found) {
        fprintf(stderr, "echo: %s\n", dlerror());
        exit(1);
    }
    return found;
}

static volatile sig_atomic_t stopped;

static void stop(int number) {
    (void)number;
    stopped = 1;
}

int main(int count, char **arguments) {
    static char frame[FRAME];
    if (count != 3) return 2;
    void *library = dlopen(arguments[1], RTLD_NOW);
    void *(*new_context)(void) = symbol(library, "zmq_ctx_new");
    void *(*new_socket)(void *, int) = symbol(library, "zmq_socket");
    int (*bind)(void *, const char *) = symbol(library, "zmq_bind");
    int (*receive)(void *, void *, size_t, int) = symbol(library, "zmq_recv");
    int (*send)(void *, const void *, size_t, int) = symbol(library, "zmq_send");
    int (*option)(void *, int, void *, size_t *) = symbol(library, "zmq_getsockopt");

    struct sigaction action = {.sa_handler = stop}; /* without SA_RESTART: zmq_recv must end */
    sigaction(SIGTERM, &action, NULL);
    void *socket = new_socket(new_context(), ZMQ_ROUTER);
    if (bind(socket, arguments[2]) < 0) return 1;
    puts("ready");
    fflush(stdout);
    while (!stopped) {
        int length = receive(socket, frame, FRAME, 0), more = 0;
        size_t size = sizeof more;
        if (length < 0) continue; /* a signal */
        option(socket, ZMQ_RCVMORE, &more, &size);
        send(socket, frame, (size_t)length, more ? ZMQ_SNDMORE : 0);
    }
    return 0;
}
