/* Laid before the C library of a user-mode-linux of Debian 12, which keeps a guest's registers in
   2696 bytes.  A processor with more of them (AMX: 11008) lets nobody set only a part: then the
   rest is read and set with it. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdarg.h>
#include <string.h>
#include <sys/uio.h>

enum { GETREGSET = 0x4204, SETREGSET = 0x4205, XSTATE = 0x202 };

long ptrace(int request, ...) {
    static long (*libc)(int, ...);
    static char whole[1 << 16];
    va_list rest;
    va_start(rest, request);
    int process = va_arg(rest, int);
    void *which = va_arg(rest, void *), *data = va_arg(rest, void *);
    va_end(rest);
    if (!libc) libc = (long (*)(int, ...))dlsym(RTLD_NEXT, "ptrace");
    if (request == SETREGSET && (long)which == XSTATE) {
        struct iovec part = *(struct iovec *)data, all = {whole, sizeof whole};
        if (libc(GETREGSET, process, which, &all) == 0 && part.iov_len < all.iov_len) {
            memcpy(whole, part.iov_base, part.iov_len);
            return libc(SETREGSET, process, which, &all);
        }
    }
    return libc(request, process, which, data);
}
