// A stand-in for the tools that tools/run.cmd starts: says how it was called, and fails at its work if PBR_VR_FAIL names it.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int main(int count, char **arguments)
{
    const char *fail = getenv("PBR_VR_FAIL");
    for (int i = 0; i < count; i++)
        printf("[%s]", arguments[i]);
    printf("\n");
    int asked_for_version = count > 1 && strcmp(arguments[1], "--version") == 0;
    return fail && strstr(arguments[0], fail) && !asked_for_version ? 7 : 0;
}
