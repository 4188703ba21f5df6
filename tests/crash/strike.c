/* Runs a program and strikes at its n-th call that changes files.
 *
 *     strike LOG MODE N program arguments...
 *
 * MODE is `count` (let it run), `kill` (SIGKILL right before the call), `full` (this call and all later
 * ones find the disk full), `denied` (this and all later ones may not change the folder) or `broken` (this
 * one call fails with an I/O error). `renames` and `plain` kill as well, but only renames count, and with
 * `plain` no two names can change places. How many such calls there were is written to LOG. Ends with
 * the program's code, 137 where it was killed, 99 where the system does not allow tracing.
 * Linux on x86-64 only.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <signal.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/user.h>
#include <sys/wait.h>
#include <unistd.h>

enum { NOT_ALLOWED = 99 };

static const int watched[] = {
    SYS_open,   SYS_openat,   SYS_creat,   SYS_mkdir,     SYS_mkdirat,  SYS_rename,
    SYS_renameat, SYS_renameat2, SYS_unlink, SYS_unlinkat, SYS_rmdir, SYS_link,
    SYS_linkat, SYS_symlink,  SYS_symlinkat, SYS_write,   SYS_pwrite64, SYS_writev,
    SYS_fsync,  SYS_fdatasync, SYS_ftruncate,
};
enum { WATCHED = sizeof watched / sizeof *watched };

/* Stops only at the calls above; all others run at full speed. */
static int install_filter(void) {
    struct sock_filter code[2 * WATCHED + 2];
    int n = 0;
    code[n++] = (struct sock_filter)BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr));
    for (int i = 0; i < WATCHED; i++) {
        code[n++] = (struct sock_filter)BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, (unsigned)watched[i], 0, 1);
        code[n++] = (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRACE);
    }
    code[n++] = (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
    struct sock_fprog program = {(unsigned short)n, code};
    return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) || prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program);
}

static int is_file(pid_t pid, long fd) {
    char path[64];
    struct stat status;
    snprintf(path, sizeof path, "/proc/%d/fd/%ld", pid, fd);
    return stat(path, &status) == 0 && S_ISREG(status.st_mode);
}

static int is_rename(const struct user_regs_struct *r) {
    return r->orig_rax == SYS_rename || r->orig_rax == SYS_renameat || r->orig_rax == SYS_renameat2;
}

/* The call does not happen and fails with `error`. */
static void fail_with(pid_t pid, struct user_regs_struct *r, int error) {
    r->orig_rax = (unsigned long long)-1;
    r->rax = (unsigned long long)-error;
    ptrace(PTRACE_SETREGS, pid, 0, r);
}

enum kind { OTHER, ADDS, FILLS, REMOVES };

/* What a call does to files: adds a name, fills what is open, or takes a name away. */
static enum kind kind_of(pid_t pid, const struct user_regs_struct *r) {
    switch (r->orig_rax) {
    case SYS_open:
        return r->rsi & O_CREAT ? ADDS : OTHER;
    case SYS_openat:
        return r->rdx & O_CREAT ? ADDS : OTHER;
    case SYS_creat: case SYS_mkdir: case SYS_mkdirat: case SYS_rename: case SYS_renameat:
    case SYS_renameat2: case SYS_link: case SYS_linkat: case SYS_symlink: case SYS_symlinkat:
        return ADDS;
    case SYS_unlink: case SYS_unlinkat: case SYS_rmdir:
        return REMOVES;
    case SYS_write: case SYS_pwrite64: case SYS_writev: case SYS_ftruncate:
        return is_file(pid, (long)r->rdi) ? FILLS : OTHER;
    case SYS_fsync: case SYS_fdatasync:
        return FILLS;
    default:
        return OTHER;
    }
}

int main(int argc, char **argv) {
    if (argc < 5)
        return 2;
    const char *mode = argv[2];
    long at = atol(argv[3]), count = 0;
    int plain = !strcmp(mode, "plain"), renames = plain || !strcmp(mode, "renames");
    pid_t child = fork();
    if (child == 0) {
        if (ptrace(PTRACE_TRACEME, 0, 0, 0))
            _exit(NOT_ALLOWED);
        raise(SIGSTOP);
        if (install_filter())
            _exit(NOT_ALLOWED);
        execv(argv[4], argv + 4);
        _exit(NOT_ALLOWED);
    }
    int status, code = NOT_ALLOWED;
    if (child < 0 || waitpid(child, &status, 0) != child || !WIFSTOPPED(status))
        return NOT_ALLOWED;
    long options = PTRACE_O_TRACECLONE | PTRACE_O_TRACEFORK | PTRACE_O_TRACEVFORK | PTRACE_O_TRACEEXEC |
                   PTRACE_O_TRACESECCOMP | PTRACE_O_EXITKILL;
    if (ptrace(PTRACE_SETOPTIONS, child, 0, options) || ptrace(PTRACE_CONT, child, 0, 0))
        return NOT_ALLOWED;
    for (;;) {
        pid_t pid = waitpid(-1, &status, __WALL);
        if (pid < 0) {
            if (errno == EINTR)
                continue;
            break;
        }
        if (WIFEXITED(status) || WIFSIGNALED(status)) {
            if (pid == child)
                code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
            continue;
        }
        long deliver = 0;
        if (status >> 8 == (SIGTRAP | PTRACE_EVENT_SECCOMP << 8)) {
            struct user_regs_struct regs;
            if (ptrace(PTRACE_GETREGS, pid, 0, &regs))
                continue;
            enum kind kind = renames && !is_rename(&regs) ? OTHER : kind_of(pid, &regs);
            if (kind != OTHER)
                count++;
            if (kind != OTHER && count >= at) {
                int error = 0;
                if (renames || !strcmp(mode, "kill")) {
                    kill(child, SIGKILL);
                    continue;
                }
                if (!strcmp(mode, "full") && kind != REMOVES)
                    error = ENOSPC;
                if (!strcmp(mode, "denied") && kind != FILLS)
                    error = EACCES;
                if (!strcmp(mode, "broken") && count == at)
                    error = EIO;
                if (error)
                    fail_with(pid, &regs, error);
            } else if (plain && regs.orig_rax == SYS_renameat2 && regs.r8 & RENAME_EXCHANGE) {
                fail_with(pid, &regs, EINVAL);
            }
        } else if (WSTOPSIG(status) != SIGTRAP && !(WSTOPSIG(status) == SIGSTOP && status >> 16 == 0 && pid != child)) {
            deliver = WSTOPSIG(status);
        }
        ptrace(PTRACE_CONT, pid, 0, deliver);
    }
    FILE *log = fopen(argv[1], "w");
    if (log) {
        fprintf(log, "%ld\n", count);
        fclose(log);
    }
    return code;
}
