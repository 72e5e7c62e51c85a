/* Writes down, in their order over all processes of a run, the writes to its journals and its store and
 * the syncs that came back, so that a power cut at any place can be replayed. Preloaded into a run.
 *
 * An entry: a letter (w write, s sync, t truncate), the length of the path, offset, length of the bytes
 * (8 bytes each, little-endian), the path, the bytes. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/types.h>
#include <unistd.h>

static int is_recorded(int fd, char path[4096]) {
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t n = readlink(link, path, 4095);
    if (n <= 0) return 0;
    path[n] = 0;
    const char *dot = strrchr(path, '.');
    return dot && (!strcmp(dot, ".journal") || !strcmp(dot, ".store") || !strcmp(dot, ".synced"));
}

static void note(char what, int fd, uint64_t offset, const void *bytes, uint64_t n) {
    char path[4096];
    const char *log = getenv("TESSERA_TEST_WRITES");
    if (!log || !is_recorded(fd, path)) return;
    uint64_t head[3] = {strlen(path), offset, n};
    size_t len = 1 + sizeof head + head[0] + n;
    char *entry = malloc(len);
    if (!entry) abort();
    entry[0] = what;
    memcpy(entry + 1, head, sizeof head);
    memcpy(entry + 1 + sizeof head, path, head[0]);
    if (n) memcpy(entry + 1 + sizeof head + head[0], bytes, n);
    int to = open(log, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
    /* One write of an appending descriptor is one piece of the file. */
    if (to < 0 || write(to, entry, len) != (ssize_t)len) abort();
    close(to);
    free(entry);
}

ssize_t pwrite64(int fd, const void *bytes, size_t n, off64_t offset) {
    ssize_t (*real)(int, const void *, size_t, off64_t) = dlsym(RTLD_NEXT, "pwrite64");
    ssize_t written = real(fd, bytes, n, offset);
    if (written > 0) note('w', fd, (uint64_t)offset, bytes, (uint64_t)written);
    return written;
}

int fdatasync(int fd) {
    int (*real)(int) = dlsym(RTLD_NEXT, "fdatasync");
    int failed = real(fd);
    if (!failed) note('s', fd, 0, NULL, 0);
    return failed;
}

int fsync(int fd) {
    int (*real)(int) = dlsym(RTLD_NEXT, "fsync");
    int failed = real(fd);
    if (!failed) note('s', fd, 0, NULL, 0);
    return failed;
}

int ftruncate64(int fd, off64_t len) {
    int (*real)(int, off64_t) = dlsym(RTLD_NEXT, "ftruncate64");
    int failed = real(fd, len);
    if (!failed) note('t', fd, (uint64_t)len, NULL, 0);
    return failed;
}
